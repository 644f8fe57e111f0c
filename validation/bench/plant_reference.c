/* The plain plant's equations with a classical Runge-Kutta integrator, written for SIMD over the joints: an independent
 * reference for the results and the speed of hand_model/kernel. WIDTH lanes fill one vector; lanes l and l + 8 are a coupled pair, so that one step of a group of
 * pairs runs in registers from the first stage to the last. Needs GNU C vectors (gcc, clang). */
#include <string.h>
#ifdef __SSE2__
#include <immintrin.h>
#endif

#ifndef WIDTH
#define WIDTH 8
#endif
enum { LANES = 16, HALF = LANES / 2, HISTORY = 128 };
/* Rows of parameters, in the order of PLANT_PARAMETERS; the bench checks their number. */
enum {
    DEAD, TAU, FILL, VENT, A0, A1, A2, A3, PHI_MAX, P_MIN, B1, T_EXT, B0, T_REC, INERTIA, FRICTION, SHARED,
    LOW, HIGH, K_STOP, D_STOP, W_STOP, LOAD, CONTACT, K_CONTACT, D_CONTACT, W_CONTACT, SUPPLY, ROWS,
    PER_TAU = ROWS, PER_T_EXT, PER_T_REC, PER_STOP, PER_CONTACT, OWN, OTHER, ARRIVAL, BEFORE, AFTER, X, WORK = X + 4
};

typedef double vec __attribute__((vector_size(8 * WIDTH)));
typedef long mask __attribute__((vector_size(8 * WIDTH)));
typedef double lanes[LANES] __attribute__((aligned(64)));
typedef struct { vec p, phi, omega, creep; } state;

const int parameter_rows = ROWS;

#define ROW(r, i) (*(const vec *)&w[r][i])
#if WIDTH == 8 && defined __AVX512F__
static inline vec max(vec a, vec b) { return _mm512_max_pd(a, b); }
static inline vec min(vec a, vec b) { return _mm512_min_pd(a, b); }
#elif WIDTH == 4 && defined __AVX__
static inline vec max(vec a, vec b) { return _mm256_max_pd(a, b); }
static inline vec min(vec a, vec b) { return _mm256_min_pd(a, b); }
#elif WIDTH == 2 && defined __SSE2__
static inline vec max(vec a, vec b) { return _mm_max_pd(a, b); }
static inline vec min(vec a, vec b) { return _mm_min_pd(a, b); }
#else
#define PICK(m, a, b) ((vec)(((m) & (mask)(a)) | (~(m) & (mask)(b))))
static inline vec max(vec a, vec b) { return PICK(a > b, a, b); }
static inline vec min(vec a, vec b) { return PICK(a < b, a, b); }
#endif
static const vec zero;

static inline vec one_sided(vec depth, vec speed, vec k, vec d, vec width, vec per_width) {
    vec inside = max(depth, zero), soft = min(inside, width), share = soft * per_width;
    return max(k * (0.5 * soft * share + (inside - soft)) + d * share * speed, zero);
}

static inline vec net_torque(const lanes *restrict w, int i, state s) {
    vec k = ROW(K_STOP, i), d = ROW(D_STOP, i), width = ROW(W_STOP, i), per_width = ROW(PER_STOP, i);
    return ROW(A0, i) + ROW(A1, i) * (s.phi - s.creep * ROW(PHI_MAX, i)) + (ROW(A2, i) + ROW(A3, i) * s.phi) * s.p
        - ROW(FRICTION, i) * s.omega - ROW(LOAD, i)
        - one_sided(s.phi - ROW(HIGH, i), s.omega, k, d, width, per_width)
        + one_sided(ROW(LOW, i) - s.phi, -s.omega, k, d, width, per_width)
        - one_sided(s.phi - ROW(CONTACT, i), s.omega, ROW(K_CONTACT, i), ROW(D_CONTACT, i), ROW(W_CONTACT, i),
                    ROW(PER_CONTACT, i));
}

static inline vec filling(const lanes *restrict w, int i, vec p, vec u) {
    return min(max((u - p) * ROW(PER_TAU, i), -ROW(VENT, i)), ROW(FILL, i));
}

static inline vec creeping(const lanes *restrict w, int i, vec p, vec creep) {
    return max((ROW(B1, i) * (p - ROW(P_MIN, i)) - creep) * ROW(PER_T_EXT, i), zero)
        + min((ROW(B0, i) * p - creep) * ROW(PER_T_REC, i), zero);
}

static inline void derivative(const lanes *restrict w, int i, const state *a, const state *b, vec u_a, vec u_b,
                              state *da, state *db) {
    int j = i + HALF;
    vec net_a = net_torque(w, i, *a), net_b = net_torque(w, j, *b);
    *da = (state){filling(w, i, a->p, u_a), a->omega, ROW(OWN, i) * net_a + ROW(OTHER, i) * net_b,
                  creeping(w, i, a->p, a->creep)};
    *db = (state){filling(w, j, b->p, u_b), b->omega, ROW(OWN, j) * net_b + ROW(OTHER, j) * net_a,
                  creeping(w, j, b->p, b->creep)};
}

static inline vec set_point(const lanes *restrict w, int i, double n) {
    vec arrived = min(max(n + 1.0 - ROW(ARRIVAL, i), zero), zero + 1.0);
    return ROW(BEFORE, i) + arrived * (ROW(AFTER, i) - ROW(BEFORE, i));
}

static inline state load(const lanes *restrict w, int i) {
    return (state){ROW(X, i), ROW(X + 1, i), ROW(X + 2, i), ROW(X + 3, i)};
}

static inline void store(lanes *restrict w, int i, state s) {
    *(vec *)&w[X][i] = s.p, *(vec *)&w[X + 1][i] = s.phi, *(vec *)&w[X + 2][i] = s.omega, *(vec *)&w[X + 3][i] = s.creep;
}

static inline state along(state s, double h, state k) {
    return (state){s.p + h * k.p, s.phi + h * k.phi, s.omega + h * k.omega, s.creep + h * k.creep};
}

#define SUM(x) (k1.x + 2.0 * (k2.x + k3.x) + k4.x)
static inline state mean(state k1, state k2, state k3, state k4) {
    return (state){SUM(p), SUM(phi), SUM(omega), SUM(creep)};
}

static inline void step(lanes *restrict w, double n, double h) {
    for (int i = 0; i < HALF; i += WIDTH) {
        int j = i + HALF;
        state a = load(w, i), b = load(w, j), s, t, a1, a2, a3, a4, b1, b2, b3, b4;
        vec u_a = set_point(w, i, n), u_b = set_point(w, j, n);
        derivative(w, i, &a, &b, u_a, u_b, &a1, &b1);
        s = along(a, 0.5 * h, a1), t = along(b, 0.5 * h, b1);
        derivative(w, i, &s, &t, u_a, u_b, &a2, &b2);
        s = along(a, 0.5 * h, a2), t = along(b, 0.5 * h, b2);
        derivative(w, i, &s, &t, u_a, u_b, &a3, &b3);
        s = along(a, h, a3), t = along(b, h, b3);
        derivative(w, i, &s, &t, u_a, u_b, &a4, &b4);
        store(w, i, along(a, h / 6.0, mean(a1, a2, a3, a4)));
        store(w, j, along(b, h / 6.0, mean(b1, b2, b3, b4)));
    }
}

static void prepare(lanes *restrict w, const double *restrict x, const double *restrict par) {
    memcpy(w, par, ROWS * sizeof(lanes));
    memcpy(w[X], x, 4 * sizeof(lanes));
    for (int i = 0; i < LANES; i++) {
        int j = (i + HALF) % LANES;
        double shared = w[SHARED][i % HALF], own = w[INERTIA][i], other = w[INERTIA][j];
        w[PER_TAU][i] = 1.0 / w[TAU][i], w[PER_T_EXT][i] = 1.0 / w[T_EXT][i], w[PER_T_REC][i] = 1.0 / w[T_REC][i];
        w[PER_STOP][i] = 1.0 / w[W_STOP][i], w[PER_CONTACT][i] = 1.0 / w[W_CONTACT][i];
        w[OWN][i] = 1.0 / (own - shared * shared / other), w[OTHER][i] = -shared / (own * other - shared * shared);
    }
}

static double cut(double u, double supply) { return u < 0.0 ? 0.0 : u > supply ? supply : u; }

static void deliver(lanes *restrict w, const double *restrict history, long head, long steps, double h) {
    for (int i = 0; i < LANES; i++) {
        double delay = w[DEAD][i] / h;
        long samples = (long)(delay / steps);
        w[ARRIVAL][i] = delay - samples * steps;
        w[AFTER][i] = cut(history[((head - samples) & (HISTORY - 1)) * LANES + i], w[SUPPLY][i]);
        w[BEFORE][i] = cut(history[((head - samples - 1) & (HISTORY - 1)) * LANES + i], w[SUPPLY][i]);
    }
}

/* One block through `samples` samples; x: (4, LANES) state, par: (ROWS, LANES), history: (HISTORY, LANES),
 * commands: (samples, LANES), out: (samples, 4, LANES). */
void advance(double *restrict x, const double *restrict par, double *restrict history, long *restrict head,
             const double *restrict commands, long samples, long steps, double h, double *restrict out) {
    lanes w[WORK];
    prepare(w, x, par);
    for (long sample = 0; sample < samples; sample++) {
        *head = (*head + 1) % HISTORY;
        memcpy(history + *head * LANES, commands + sample * LANES, sizeof(lanes));
        deliver(w, history, *head, steps, h);
        for (long n = 0; n < steps; n++) step(w, n, h);
        memcpy(out + sample * 4 * LANES, w[X], 4 * sizeof(lanes));
    }
    memcpy(x, w[X], 4 * sizeof(lanes));
}
