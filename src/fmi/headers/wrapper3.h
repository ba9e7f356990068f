#include "fmi3Functions.h"
