/* The importer's fmi2CallbackLogger. A variadic function cannot be defined in stable Rust, so this
 * shim formats the message into a bounded buffer and hands plain strings on. */
#include <stdarg.h>
#include <stdio.h>
#include "fmi2FunctionTypes.h"

void bess_logger_receive(fmi2ComponentEnvironment environment, fmi2String instance_name, int status,
                         fmi2String category, const char *message);

void bess_logger(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                 fmi2String category, fmi2String message, ...) {
    char text[4096];
    va_list arguments;
    va_start(arguments, message);
    int written = message ? vsnprintf(text, sizeof text, message, arguments) : -1;
    va_end(arguments);
    bess_logger_receive(environment, instance_name, (int)status, category,
                        written < 0 ? "(a log message that could not be formatted)" : text);
}
