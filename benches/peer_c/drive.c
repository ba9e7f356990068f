/* A master that does nothing but call: sets all Real inputs, steps, gets the setpoints. Any FMUs of the controller of
 * Case 1 whose variables come in the order of modelDescription/BessConsensus.xml, through their C functions, on
 * measurements recorded before. Run by `cargo xtask bench`; as a program, or as a library within Python, where FMUs made
 * by PythonFMU find their interpreter. Prints one line of JSON.
 *
 *   drive compare INPUTS ROUNDS FMU FMU     largest difference of any setpoint, then time per step, in turn
 *   drive count INPUTS STEPS FMU            steps and says nothing: for valgrind
 *
 * FMU: LIBRARY GUID RESOURCES FIRST, the last being the value reference of P[1].
 * INPUTS: a text, number of steps, length of one in s, then a line of P Q V omega E of all agents for each step.
 */
#define _GNU_SOURCE
#include "fmi2Functions.h"
#include <dlfcn.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { N = 7, MEASURED = 5 * N, INPUTS = MEASURED + 3, SETPOINTS = 4 * N };
enum { ENABLE = INPUTS, OMEGA_SET = ENABLE + 1 + 1 + N + 1 }; /* after the first: enable, dispatch, available, topology */

typedef struct {
    fmi2InstantiateTYPE *instantiate;
    fmi2FreeInstanceTYPE *free_instance;
    fmi2SetupExperimentTYPE *setup_experiment;
    fmi2EnterInitializationModeTYPE *enter_initialization;
    fmi2ExitInitializationModeTYPE *exit_initialization;
    fmi2TerminateTYPE *terminate;
    fmi2SetRealTYPE *set_real;
    fmi2SetBooleanTYPE *set_boolean;
    fmi2GetRealTYPE *get_real;
    fmi2DoStepTYPE *do_step;
    char **words;
    fmi2Component component;
    fmi2ValueReference inputs[INPUTS], setpoints[SETPOINTS], enable;
} Fmu;

typedef struct {
    int steps;
    double h;
    double *rows; /* INPUTS each */
} Record;

static void die(const char *format, ...) {
    va_list words;
    va_start(words, format);
    fputs("drive: ", stderr);
    vfprintf(stderr, format, words);
    fputc('\n', stderr);
    va_end(words);
    exit(1);
}

static void must(fmi2Status status, const char *what) {
    if (status != fmi2OK) die("%s returned %d", what, (int)status);
}

static void show(fmi2ComponentEnvironment e, fmi2String name, fmi2Status status, fmi2String category, fmi2String text, ...) {
    va_list words;
    (void)e, (void)category;
    va_start(words, text);
    fprintf(stderr, "%s (%d): ", name, (int)status);
    vfprintf(stderr, text, words);
    fputc('\n', stderr);
    va_end(words);
}

static const fmi2CallbackFunctions CALLBACKS = {show, calloc, free, NULL, NULL};

static void *find(void *library, const char *name) {
    void *function = dlsym(library, name);
    if (!function) die("%s", dlerror());
    return function;
}

static Fmu load(char **words) {
    Fmu f;
    void *library = dlopen(words[0], RTLD_NOW | RTLD_LOCAL);
    if (!library) die("%s", dlerror());
    *(void **)&f.instantiate = find(library, "fmi2Instantiate");
    *(void **)&f.free_instance = find(library, "fmi2FreeInstance");
    *(void **)&f.setup_experiment = find(library, "fmi2SetupExperiment");
    *(void **)&f.enter_initialization = find(library, "fmi2EnterInitializationMode");
    *(void **)&f.exit_initialization = find(library, "fmi2ExitInitializationMode");
    *(void **)&f.terminate = find(library, "fmi2Terminate");
    *(void **)&f.set_real = find(library, "fmi2SetReal");
    *(void **)&f.set_boolean = find(library, "fmi2SetBoolean");
    *(void **)&f.get_real = find(library, "fmi2GetReal");
    *(void **)&f.do_step = find(library, "fmi2DoStep");
    unsigned first = (unsigned)strtoul(words[3], NULL, 10);
    for (int k = 0; k < INPUTS; k++) f.inputs[k] = first + k;
    for (int k = 0; k < SETPOINTS; k++) f.setpoints[k] = first + OMEGA_SET + k;
    f.enable = first + ENABLE;
    f.words = words;
    f.component = NULL;
    return f;
}

static Record record(const char *path) {
    Record r;
    FILE *file = fopen(path, "r");
    if (!file || fscanf(file, "%d %lf", &r.steps, &r.h) != 2 || r.steps < 1) die("%s: no record", path);
    r.rows = malloc(sizeof(double) * INPUTS * (size_t)r.steps);
    if (!r.rows) die("out of memory");
    for (int k = 0; k < r.steps; k++) {
        double *row = r.rows + (size_t)INPUTS * k;
        for (int j = 0; j < MEASURED; j++)
            if (fscanf(file, "%lf", row + j) != 1) die("%s: step %d is incomplete", path, k);
        row[MEASURED] = row[MEASURED + 1] = 1.0; /* omega_ref, V_ref */
        row[MEASURED + 2] = 0.0;                 /* P_ref */
    }
    fclose(file);
    return r;
}

/* A new instance up to its first step, the controller on. */
static void begin(Fmu *f, const Record *r) {
    fmi2Boolean on = fmi2True;
    f->component = f->instantiate("drive", fmi2CoSimulation, f->words[1], f->words[2], &CALLBACKS, fmi2False, fmi2False);
    if (!f->component) die("%s: fmi2Instantiate returned NULL", f->words[0]);
    must(f->setup_experiment(f->component, fmi2False, 0.0, 0.0, fmi2False, 0.0), "fmi2SetupExperiment");
    must(f->set_real(f->component, f->inputs, INPUTS, r->rows), "fmi2SetReal");
    must(f->set_boolean(f->component, &f->enable, 1, &on), "fmi2SetBoolean");
    must(f->enter_initialization(f->component), "fmi2EnterInitializationMode");
    must(f->exit_initialization(f->component), "fmi2ExitInitializationMode");
}

static void end(Fmu *f) {
    must(f->terminate(f->component), "fmi2Terminate");
    f->free_instance(f->component);
}

static void step(Fmu *f, const Record *r, int k, double *setpoints) {
    fmi2Status set = f->set_real(f->component, f->inputs, INPUTS, r->rows + (size_t)INPUTS * k);
    fmi2Status done = f->do_step(f->component, k * r->h, r->h, fmi2True);
    fmi2Status got = f->get_real(f->component, f->setpoints, SETPOINTS, setpoints);
    if (set != fmi2OK || done != fmi2OK || got != fmi2OK) die("step %d returned %d %d %d", k, set, done, got);
}

/* Time of the processor, not of the clock on the wall: other programs may be running. */
static double pass_ns(Fmu *f, const Record *r) {
    double setpoints[SETPOINTS];
    struct timespec from, to;
    begin(f, r);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &from);
    for (int k = 0; k < r->steps; k++) step(f, r, k, setpoints);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &to);
    end(f);
    return (1e9 * (double)(to.tv_sec - from.tv_sec) + (double)(to.tv_nsec - from.tv_nsec)) / r->steps;
}

static double largest_difference(Fmu *f, Fmu *g, const Record *r) {
    double a[SETPOINTS], b[SETPOINTS], apart = 0.0;
    begin(f, r);
    begin(g, r);
    for (int k = 0; k < r->steps; k++) {
        step(f, r, k, a);
        step(g, r, k, b);
        for (int j = 0; j < SETPOINTS; j++) {
            double d = fabs(a[j] - b[j]);
            if (!(d <= apart)) apart = d;
        }
    }
    end(f);
    end(g);
    return apart;
}

static void list(const char *name, const double *values, int count) {
    printf(", \"%s\": [", name);
    for (int k = 0; k < count; k++) printf("%s%.4f", k ? ", " : "", values[k]);
    printf("]");
}

static int compare(const Record *r, int rounds, Fmu *f, Fmu *g) {
    double *ns = calloc(2 * (size_t)rounds, sizeof *ns);
    if (!ns) die("out of memory");
    double apart = largest_difference(f, g, r);
    for (int k = 0; k < rounds; k++) {
        /* Who goes first takes turns too. */
        if (k % 2) ns[rounds + k] = pass_ns(g, r);
        ns[k] = pass_ns(f, r);
        if (k % 2 == 0) ns[rounds + k] = pass_ns(g, r);
    }
    printf("{\"steps\": %d, \"apart\": %.3e", r->steps, apart);
    list("first_ns", ns, rounds);
    list("second_ns", ns + rounds, rounds);
    printf("}\n");
    free(ns);
    return 0;
}

#ifdef WITHIN_PYTHON
__attribute__((visibility("default"))) int drive(int words, char **word)
#else
int main(int words, char **word)
#endif
{
    enum { FMU_WORDS = 4 };
    int count = words > 3 ? atoi(word[3]) : 0;
    if (words == 4 + 2 * FMU_WORDS && strcmp(word[1], "compare") == 0 && count > 0) {
        Record r = record(word[2]);
        Fmu f = load(word + 4), g = load(word + 4 + FMU_WORDS);
        compare(&r, count, &f, &g);
        free(r.rows);
    } else if (words == 4 + FMU_WORDS && strcmp(word[1], "count") == 0 && count > 0) {
        Record r = record(word[2]);
        if (count > r.steps) die("%s has %d steps only", word[2], r.steps);
        r.steps = count;
        Fmu f = load(word + 4);
        pass_ns(&f, &r);
        free(r.rows);
    } else {
        die("usage: compare INPUTS ROUNDS FMU FMU, or count INPUTS STEPS FMU; FMU: LIBRARY GUID RESOURCES FIRST");
    }
    return fflush(stdout);
}
