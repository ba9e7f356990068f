/* The controller of Case 1 written by hand: seven agents, one graph, the sampled law of docs/paper.md and nothing else.
 * What `cargo xtask bench --only fmu` measures BessConsensus.fmu against. No scenario, no plug and play, no delays,
 * no limits, no diagnostics; value references are those of modelDescription/BessConsensus.xml, so that one driver
 * serves both. Build: cc -O3 -fPIC -shared -fvisibility=hidden -I src/fmi/headers peer.c -lm
 */
#include "fmi2Functions.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define GUID "1a0f4c1e-6f5b-4d0c-9d8e-7c5d51c1b007"

enum { N = 7, EDGES = 6, PINS = 2 };

/* Value references; those of arrays are of their first elements. */
enum { P = 1, Q = P + N, V = Q + N, OMEGA = V + N, E = OMEGA + N, OMEGA_REF = E + N, V_REF, P_REF, INPUTS_END };
enum { ENABLE = INPUTS_END, DISPATCH };
enum { OMEGA_SET = DISPATCH + 1 + N + 1, V_SET = OMEGA_SET + N, P_SET = V_SET + N, Q_SET = P_SET + N, OUTPUTS_END = Q_SET + N };

static const double K_P[N] = {0.004, 0.0048, 0.005, 0.0036, 0.0038, 0.00408, 0.0044};
static const double K_Q[N] = {0.02, 0.0242, 0.026, 0.0246, 0.019, 0.0212, 0.0226};
static const double OMEGA_SET_START[N] = {1.0015, 0.999, 1.0005, 0.9985, 1.001, 0.9995, 1.0};
static const double V_SET_START = 1.02;
static const double P_EXCHANGE_MAX = 1.0;
static const double GAIN_OMEGA = 1.0, GAIN_P = 1.0, GAIN_E = 0.003, GAIN_V = 1.0, GAIN_Q = 1.0;
static const double THETA_E = 1.0, FADE = 2.0;

/* Topology a3: a tree in each cluster, an edge between the active leaders 1 and 7, which are pinned. */
static const struct { int a, b; double weight; } EDGE[EDGES] = {
    {0, 1, 1.0},
    {0, 6, 0.3721517199979191},
    {1, 2, 0.4729300730786073},
    {3, 4, 0.37587253293781075},
    {4, 5, 0.6039036919833249},
    {5, 6, 0.41901320721271484},
};
static const int PIN[PINS] = {0, 6};
static const double PIN_WEIGHT = 1.0;
/* Neighbours; a pinned agent's virtual leader counts in the boundary layer, not in the exchange. */
static const int PEERS[N] = {2, 2, 1, 1, 2, 2, 2};
static const int DEGREE[N] = {3, 2, 1, 1, 2, 2, 3};

typedef enum { INSTANTIATED, INITIALIZATION, STEP, TERMINATED } State;

typedef struct {
    State state;
    fmi2CallbackLogger log;
    fmi2ComponentEnvironment environment;
    char *name;
    double time, fade_left;
    fmi2Boolean enable, dispatch;
    double real[OUTPUTS_END]; /* by value reference */
    double flow[EDGES];       /* of the exchange in the last step */
    double capacity[N];
    double share[EDGES];          /* 1 / (1 + max(degrees)) */
    double exchange_cap[EDGES];   /* 3600 min(C) / (1 + max(peers)) */
    double exchange_limit[EDGES]; /* min(P_exchange_max / peers) */
    double pin_share[PINS];
} Peer;

static fmi2Status refuse(const Peer *m, const char *what) {
    if (m->log) m->log(m->environment, m->name, fmi2Error, "logStatusError", "%s", what);
    return fmi2Error;
}

static double least(double a, double b) { return a < b ? a : b; }
static int most(int a, int b) { return a > b ? a : b; }

static void start(Peer *m) {
    m->state = INSTANTIATED;
    m->time = 0.0;
    m->fade_left = FADE;
    m->enable = m->dispatch = fmi2False;
    memset(m->real, 0, sizeof m->real);
    memset(m->flow, 0, sizeof m->flow);
    for (int i = 0; i < N; i++) {
        m->capacity[i] = 0.5 * K_P[0] / K_P[i];
        m->real[V + i] = m->real[OMEGA + i] = 1.0;
        m->real[OMEGA_SET + i] = OMEGA_SET_START[i];
        m->real[V_SET + i] = V_SET_START;
    }
    m->real[OMEGA_REF] = m->real[V_REF] = 1.0;
    for (int e = 0; e < EDGES; e++) {
        int a = EDGE[e].a, b = EDGE[e].b;
        m->share[e] = 1.0 / (1.0 + most(DEGREE[a], DEGREE[b]));
        m->exchange_cap[e] = 3600.0 * least(m->capacity[a], m->capacity[b]) / (1.0 + most(PEERS[a], PEERS[b]));
        m->exchange_limit[e] = least(P_EXCHANGE_MAX / PEERS[a], P_EXCHANGE_MAX / PEERS[b]);
    }
    for (int k = 0; k < PINS; k++) m->pin_share[k] = 1.0 / (1.0 + DEGREE[PIN[k]]);
}

/* f = sgn(d) min(g w sqrt(abs(d)), abs(d) share / theta): eta is 1/2. */
static inline double flow(double gain, double weight, double d, double cap) {
    double size = fabs(d);
    return copysign(least(gain * weight * sqrt(size), size * cap), d);
}

/* Setpoints over one step of h from the measurements of its beginning. */
static void advance(Peer *m, double h) {
    double *r = m->real;
    double p[N], q[N], soc[N], u_omega[N] = {0}, u_P[N] = {0}, u_V[N] = {0}, u_Q[N] = {0}, exchange[N] = {0};
    const double *omega = r + OMEGA, *v = r + V;
    double inverse_theta = 1.0 / h, inverse_theta_E = 1.0 / (h > THETA_E ? h : THETA_E);
    double fade = h >= m->fade_left ? 1.0 : h / m->fade_left;
    for (int i = 0; i < N; i++) {
        p[i] = K_P[i] * (r[P + i] - r[P_SET + i]);
        q[i] = K_Q[i] * (r[Q + i] - r[Q_SET + i]);
        soc[i] = r[E + i] / m->capacity[i];
    }
    for (int e = 0; e < EDGES; e++) {
        int a = EDGE[e].a, b = EDGE[e].b;
        double w = EDGE[e].weight, cap = m->share[e] * inverse_theta;
        double f_omega = flow(GAIN_OMEGA, w, omega[a] - omega[b], cap);
        double f_P = flow(GAIN_P, w, p[a] - p[b], cap);
        double f_V = flow(GAIN_V, w, v[a] - v[b], cap);
        double f_Q = flow(GAIN_Q, w, q[a] - q[b], cap);
        double f_E = flow(3600.0 * GAIN_E, w, soc[a] - soc[b], m->exchange_cap[e] * inverse_theta_E);
        f_E = copysign(least(fabs(f_E), m->exchange_limit[e]), f_E);
        m->flow[e] = fade < 1.0 ? m->flow[e] + fade * (f_E - m->flow[e]) : f_E;
        u_omega[a] -= f_omega, u_omega[b] += f_omega;
        u_P[a] -= f_P, u_P[b] += f_P;
        u_V[a] -= f_V, u_V[b] += f_V;
        u_Q[a] -= f_Q, u_Q[b] += f_Q;
        exchange[a] += m->flow[e], exchange[b] -= m->flow[e];
    }
    for (int k = 0; k < PINS; k++) {
        int i = PIN[k];
        double cap = m->pin_share[k] * inverse_theta;
        u_omega[i] -= flow(GAIN_OMEGA, PIN_WEIGHT, omega[i] - r[OMEGA_REF], cap);
        u_V[i] -= flow(GAIN_V, PIN_WEIGHT, v[i] - r[V_REF], cap);
        if (m->dispatch) u_P[i] -= flow(GAIN_P, PIN_WEIGHT, p[i] - r[P_REF], cap);
    }
    for (int i = 0; i < N; i++) {
        r[OMEGA_SET + i] += h * (u_omega[i] + u_P[i]);
        r[V_SET + i] += h * (u_V[i] + u_Q[i]);
        r[P_SET + i] = exchange[i];
    }
    m->fade_left = m->fade_left > h ? m->fade_left - h : 0.0;
}

/* The functions that a master calls. */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || !name || !guid || strcmp(guid, GUID) != 0) return NULL;
    Peer *m = calloc(1, sizeof *m);
    if (!m) return NULL;
    m->name = strdup(name);
    if (!m->name) return free(m), NULL;
    if (callbacks) m->log = callbacks->logger, m->environment = callbacks->componentEnvironment;
    start(m);
    return m;
}

void fmi2FreeInstance(fmi2Component c) {
    Peer *m = c;
    if (m) free(m->name);
    free(m);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start_time,
                               fmi2Boolean has_stop, fmi2Real stop_time) {
    Peer *m = c;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_time;
    if (!m) return fmi2Error;
    if (m->state != INSTANTIATED) return refuse(m, "fmi2SetupExperiment: only after fmi2Instantiate");
    m->time = start_time;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Peer *m = c;
    if (!m) return fmi2Error;
    if (m->state != INSTANTIATED) return refuse(m, "fmi2EnterInitializationMode: only after fmi2Instantiate");
    m->state = INITIALIZATION;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Peer *m = c;
    if (!m) return fmi2Error;
    if (m->state != INITIALIZATION) return refuse(m, "fmi2ExitInitializationMode: only in initialization mode");
    m->state = STEP;
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
    Peer *m = c;
    if (!m) return fmi2Error;
    m->state = TERMINATED;
    return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
    Peer *m = c;
    if (!m) return fmi2Error;
    start(m);
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    Peer *m = c;
    if (!m || (nvr && (!vr || !value))) return fmi2Error;
    if (m->state == TERMINATED) return refuse(m, "fmi2SetReal: not after fmi2Terminate");
    for (size_t k = 0; k < nvr; k++) {
        if (vr[k] < P || vr[k] >= INPUTS_END) return refuse(m, "fmi2SetReal: no Real input with this value reference");
        if (!isfinite(value[k])) return refuse(m, "fmi2SetReal: expected a finite value");
        m->real[vr[k]] = value[k];
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
    Peer *m = c;
    if (!m || (nvr && (!vr || !value))) return fmi2Error;
    if (m->state == TERMINATED) return refuse(m, "fmi2SetBoolean: not after fmi2Terminate");
    for (size_t k = 0; k < nvr; k++) {
        switch (vr[k]) {
        case ENABLE: m->enable = value[k]; break;
        case DISPATCH: m->dispatch = value[k]; break;
        default: return refuse(m, "fmi2SetBoolean: no Boolean input with this value reference");
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    Peer *m = c;
    if (!m || (nvr && (!vr || !value))) return fmi2Error;
    for (size_t k = 0; k < nvr; k++) {
        int is_input = vr[k] >= P && vr[k] < INPUTS_END, is_output = vr[k] >= OMEGA_SET && vr[k] < OUTPUTS_END;
        if (!is_input && !is_output) return refuse(m, "fmi2GetReal: no Real variable with this value reference");
        value[k] = m->real[vr[k]];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point, fmi2Real h, fmi2Boolean no_set_prior) {
    Peer *m = c;
    (void)no_set_prior;
    if (!m) return fmi2Error;
    if (m->state != STEP) return refuse(m, "fmi2DoStep: only after fmi2ExitInitializationMode");
    if (!(h > 0.0) || !isfinite(h)) return refuse(m, "fmi2DoStep: expected a step longer than 0 s");
    if (fabs(point - m->time) > 1e-6 * h + 1e-9) return refuse(m, "fmi2DoStep: not where the last step ended");
    if (m->enable) advance(m, h);
    m->time = point + h;
    return fmi2OK;
}
