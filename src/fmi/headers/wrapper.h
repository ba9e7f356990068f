#include "fmi2Functions.h"
