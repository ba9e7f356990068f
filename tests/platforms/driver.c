/* Couples FMUs by a plan and prints numbers: the same program on every platform, so that what differs is the FMUs.
 *
 *   driver run PLAN        PLAN is a text file, see plan.py
 *   driver panic LIBRARY RESOURCES   instantiates, and is still there to say that it got NULL
 *
 * Knows the few FMI 2.0 functions that it calls, and neither units nor names. Any failure ends it with 1. */

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
static void *open_library(const char *path) { return (void *)LoadLibraryA(path); }
static void *symbol(void *library, const char *name) { return (void *)GetProcAddress((HMODULE)library, name); }
static const char *why(void) {
    static char text[32];
    snprintf(text, sizeof text, "error %lu", GetLastError());
    return text;
}
#else
#include <dlfcn.h>
static void *open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
static void *symbol(void *library, const char *name) { return dlsym(library, name); }
static const char *why(void) { return dlerror(); }
#endif

#include "fmi2FunctionTypes.h"

#define MOST 4096

static void fail(const char *what, const char *detail) {
    fprintf(stderr, "driver: %s: %s\n", what, detail ? detail : "");
    exit(1);
}

static void logger(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s %d %s: ", instance, (int)status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};

typedef struct {
    char library[1024], guid[256], resources[1024];
    fmi2Component component;
    fmi2InstantiateTYPE *instantiate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2GetRealTYPE *get;
    fmi2SetRealTYPE *set;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2DoStepTYPE *step;
    fmi2TerminateTYPE *terminate;
} Part;

typedef struct { int from, to; fmi2ValueReference output, input; } Connection;
typedef struct { double time, value; int part; char kind; fmi2ValueReference input; } Event;
typedef struct { int part; fmi2ValueReference output; } Watch;

static Part parts[2];
static Connection connections[MOST];
static Event events[MOST];
static Watch watches[MOST];
static int n_parts, n_connections, n_events, n_watches;
static double stop, step;

static void ok(fmi2Status status, const char *what) {
    if (status != fmi2OK) fail(what, "did not return fmi2OK");
}

static void *needed(void *library, const char *name) {
    void *function = symbol(library, name);
    if (!function) fail(name, why());
    return function;
}

static void load(Part *part, const char *name) {
    void *library = open_library(part->library);
    if (!library) fail(part->library, why());
    part->instantiate = (fmi2InstantiateTYPE *)needed(library, "fmi2Instantiate");
    part->free_instance = (fmi2FreeInstanceTYPE *)needed(library, "fmi2FreeInstance");
    part->setup = (fmi2SetupExperimentTYPE *)needed(library, "fmi2SetupExperiment");
    part->enter = (fmi2EnterInitializationModeTYPE *)needed(library, "fmi2EnterInitializationMode");
    part->leave = (fmi2ExitInitializationModeTYPE *)needed(library, "fmi2ExitInitializationMode");
    part->get = (fmi2GetRealTYPE *)needed(library, "fmi2GetReal");
    part->set = (fmi2SetRealTYPE *)needed(library, "fmi2SetReal");
    part->set_boolean = (fmi2SetBooleanTYPE *)needed(library, "fmi2SetBoolean");
    part->step = (fmi2DoStepTYPE *)needed(library, "fmi2DoStep");
    part->terminate = (fmi2TerminateTYPE *)needed(library, "fmi2Terminate");
    part->component = part->instantiate(name, fmi2CoSimulation, part->guid, part->resources, &callbacks, fmi2False, fmi2False);
}

/* The rest of a line after its first word. */
static void rest(char *line, char *into, size_t size) {
    char *text = strchr(line, ' ');
    if (!text || strlen(text + 1) >= size) fail("bad line in the plan", line);
    strcpy(into, text + 1);
}

static void read_plan(const char *path) {
    static char line[2048];
    FILE *file = fopen(path, "r");
    if (!file) fail("cannot open", path);
    while (fgets(line, sizeof line, file)) {
        line[strcspn(line, "\r\n")] = 0;
        Part *part = &parts[n_parts > 0 ? n_parts - 1 : 0];
        if (n_connections == MOST || n_events == MOST || n_watches == MOST) fail("too long", path);
        Connection *c = &connections[n_connections];
        Event *e = &events[n_events];
        Watch *w = &watches[n_watches];
        if (!strncmp(line, "library ", 8)) {
            if (n_parts == 2) fail("more than two parts", path);
            rest(line, parts[n_parts++].library, sizeof part->library);
        } else if (!strncmp(line, "guid ", 5)) rest(line, part->guid, sizeof part->guid);
        else if (!strncmp(line, "resources ", 10)) rest(line, part->resources, sizeof part->resources);
        else if (sscanf(line, "connect %d %u %d %u", &c->from, &c->output, &c->to, &c->input) == 4) n_connections++;
        else if (sscanf(line, "event %lf %c %d %u %lf", &e->time, &e->kind, &e->part, &e->input, &e->value) == 5) n_events++;
        else if (sscanf(line, "watch %d %u", &w->part, &w->output) == 2) n_watches++;
        else if (sscanf(line, "run %lf %lf", &stop, &step) != 2) fail("bad line in the plan", line);
    }
    fclose(file);
}

/* Hands on what one part (or, with -1, either) gives to the other. */
static void pass_on(int from) {
    for (int i = 0; i < n_connections; i++) {
        const Connection *c = &connections[i];
        double value;
        if (from >= 0 && c->from != from) continue;
        ok(parts[c->from].get(parts[c->from].component, &c->output, 1, &value), "fmi2GetReal");
        ok(parts[c->to].set(parts[c->to].component, &c->input, 1, &value), "fmi2SetReal");
    }
}

static void happen(double time) {
    for (int i = 0; i < n_events; i++) {
        Event *e = &events[i];
        if (e->kind == 0 || time < e->time - 1e-9) continue;
        Part *part = &parts[e->part];
        fmi2Boolean truth = e->value != 0;
        if (e->kind == 'b') ok(part->set_boolean(part->component, &e->input, 1, &truth), "fmi2SetBoolean");
        else ok(part->set(part->component, &e->input, 1, &e->value), "fmi2SetReal");
        e->kind = 0;
    }
}

static void print(double time) {
    printf("%.17g", time);
    for (int i = 0; i < n_watches; i++) {
        double value;
        Part *part = &parts[watches[i].part];
        ok(part->get(part->component, &watches[i].output, 1, &value), "fmi2GetReal");
        printf(" %.17g", value);
    }
    printf("\n");
}

static int run(const char *plan) {
    read_plan(plan);
    if (n_parts != 2 || !(step > 0)) fail("two parts and a step are needed", plan);
    for (int i = 0; i < 2; i++) {
        load(&parts[i], i ? "second" : "first");
        if (!parts[i].component) fail(parts[i].library, "fmi2Instantiate gave NULL");
        ok(parts[i].setup(parts[i].component, fmi2False, 0, 0, fmi2True, stop), "fmi2SetupExperiment");
        ok(parts[i].enter(parts[i].component), "fmi2EnterInitializationMode");
    }
    pass_on(-1);
    pass_on(-1);
    for (int i = 0; i < 2; i++) ok(parts[i].leave(parts[i].component), "fmi2ExitInitializationMode");
    int steps = (int)(stop / step + 0.5), per_second = (int)(1 / step + 0.5);
    for (int k = 0; k < steps; k++) {
        double time = k * step;
        happen(time);
        pass_on(-1);
        if (k % per_second == 0) print(time);
        for (int i = 0; i < 2; i++) ok(parts[i].step(parts[i].component, time, step, fmi2True), "fmi2DoStep");
    }
    print(stop);
    for (int i = 0; i < 2; i++) {
        ok(parts[i].terminate(parts[i].component), "fmi2Terminate");
        parts[i].free_instance(parts[i].component);
    }
    return 0;
}

static int survive_panic(const char *library, const char *resources) {
    Part part = {0};
    snprintf(part.library, sizeof part.library, "%s", library);
    snprintf(part.resources, sizeof part.resources, "%s", resources);
    load(&part, "mock");
    printf(part.component ? "instantiated\n" : "fenced\n");
    return 0;
}

int main(int count, char **words) {
    if (count == 3 && !strcmp(words[1], "run")) return run(words[2]);
    if (count == 4 && !strcmp(words[1], "panic")) return survive_panic(words[2], words[3]);
    fail("usage", "driver run PLAN | driver panic LIBRARY RESOURCES");
}
