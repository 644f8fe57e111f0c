/* See hand_law.h. The order of operations is that of the Python law, so that both round alike. */
#include "hand_law.h"

#define G(name) g[HAND_G_##name * n + i]
#define S(name) s[HAND_S_##name * n + i]
#define OUT(name) out[HAND_O_##name * n + i]
#define R(x) ((hand_real)(x))
#define U(name) u[HAND_U_##name * n + i]

static hand_real low_of(hand_real a, hand_real b) { return a < b ? a : b; }
static hand_real high_of(hand_real a, hand_real b) { return a > b ? a : b; }
static hand_real bounded(hand_real x, hand_real low, hand_real high) { return low_of(high_of(x, low), high); }
static hand_real size_of(hand_real x) { return x < 0 ? -x : x; }
static int finite_real(hand_real x) { return x - x == 0; }

static hand_real root(hand_real x)
{
    return sizeof(hand_real) == sizeof(float) ? (hand_real)__builtin_sqrtf((float)x) : (hand_real)__builtin_sqrt((double)x);
}

static hand_real torque(hand_real p, hand_real phi, hand_real creep, hand_real a0, hand_real a1, hand_real a2,
                        hand_real a3, hand_real phi_max)
{
    return a0 + a1 * (phi - creep * phi_max) + (a2 + a3 * phi) * p;
}

static hand_real pressure_for(hand_real tau, hand_real phi, hand_real creep, hand_real a0, hand_real a1, hand_real a2,
                              hand_real a3, hand_real phi_max)
{
    return (tau - a0 - a1 * (phi - creep * phi_max)) / (a2 + a3 * phi);
}

static hand_real stiffness_of(hand_real p, hand_real a1, hand_real a3) { return a1 + a3 * p; }
static hand_real leverage(hand_real phi, hand_real a2, hand_real a3) { return a2 + a3 * phi; }

static hand_real creep_rate(hand_real p, hand_real creep, const hand_real *g, int n, int i)
{
    const hand_real extension = (G(B1) * (p - G(P_MIN)) - creep) * G(EXTENSION_RATE);
    const hand_real recovery = (G(B0) * p - creep) * G(RECOVERY_RATE);
    return high_of(extension, 0) + low_of(recovery, 0);
}

/* True torque over that of the adapted map: the common part of the changes is an error of a2, on average. */
static hand_real torque_scale(int n, int i, const hand_real *s)
{
    const hand_real common = -HAND_C_COMMON / (1 + 2 * HAND_C_COMMON) * (S(D_A1) + S(D_A3));
    return 1 + bounded(common, -HAND_C_MOST_SCALE, HAND_C_MOST_SCALE);
}

static void reset_covariance(int n, int i, const hand_real *g, hand_real *s)
{
    const hand_real variance = G(MAP_UNCERTAINTY) * G(MAP_UNCERTAINTY);
    for (int k = 0; k < 10; k++) s[(HAND_S_C00 + k) * n + i] = 0;
    S(C00) = G(LOAD_STD) * G(LOAD_STD);
    S(C11) = S(C22) = S(C33) = (1 + HAND_C_COMMON) * variance;
    S(C12) = S(C13) = S(C23) = HAND_C_COMMON * variance;
}

static int follows(hand_real reference_speed, hand_real speed)
{
    return size_of(reference_speed) > HAND_C_MOVING_SPEED
        && speed * reference_speed > HAND_C_MOVING_SHARE * reference_speed * reference_speed;
}

static int contradicted_by_motion(int n, int i, hand_real *s, hand_real reference_speed, hand_real dt)
{
    S(MOVING) = follows(reference_speed, S(SPEED)) && S(CONTACT) != 0 ? S(MOVING) + dt : 0;
    if (S(MOVING) <= HAND_C_MOVING_TIME) return 0;
    S(CONTACT) = S(SUM) = S(AGE) = S(MOVING) = 0;
    return 1;
}

static void observe(int n, int i, const hand_real *g, hand_real *s, hand_real phi, hand_real p, hand_real dt)
{
    if (S(STARTED) == 0) {
        S(STARTED) = 1;
        S(LAST_ANGLE) = S(PHI_1) = S(PHI_2) = phi;
        S(P_1) = S(P_2) = p;
        S(Q_1) = S(Q_2) = p * phi;
        S(FOUND_1) = S(FOUND_2) = S(LOAD) + S(DRAG);
        S(SPEED) = 0;
        return;
    }
    if (!(dt > 0)) return;
    const hand_real rate = (phi - S(LAST_ANGLE)) / dt;
    S(SPEED) += dt / (dt + G(SPEED_FILTER)) * (rate - S(SPEED));
    S(LAST_ANGLE) = phi;
    const hand_real t = G(OBSERVER_FILTER), share = dt / (dt + t);
    S(PHI_1) += share * (phi - S(PHI_1));
    S(P_1) += share * (p - S(P_1));
    S(Q_1) += share * (p * phi - S(Q_1));
    S(PHI_2) += share * (S(PHI_1) - S(PHI_2));
    S(P_2) += share * (S(P_1) - S(P_2));
    S(Q_2) += share * (S(Q_1) - S(Q_2));
    S(FOUND_1) += share * (S(LOAD) + S(DRAG) - S(FOUND_1));
    S(FOUND_2) += share * (S(FOUND_1) - S(FOUND_2));
    S(ACCELERATION) = (phi - 2 * S(PHI_1) + S(PHI_2)) / (t * t);
    if (G(CREEP) != 0) S(CREEP) = bounded(S(CREEP) + creep_rate(p, S(CREEP), g, n, i) * dt, 0, 1);
}

static void regressors(int n, int i, const hand_real *g, const hand_real *s, hand_real speed, hand_real r[4])
{
    r[0] = 1;
    r[1] = G(A1) * (S(PHI_2) - S(CREEP) * G(PHI_MAX));
    r[2] = G(A3) * S(Q_2);
    r[3] = -G(VISCOUS) * speed;
}

static hand_real map_variance(int n, int i, const hand_real *g, const hand_real *s, hand_real speed)
{
    hand_real r[4];
    regressors(n, i, g, s, speed, r);
    const hand_real own = S(C00) * r[0] * r[0] + S(C11) * r[1] * r[1] + S(C22) * r[2] * r[2] + S(C33) * r[3] * r[3];
    hand_real pairs = r[0] * (S(C01) * r[1] + S(C02) * r[2] + S(C03) * r[3]);
    pairs += r[1] * (S(C12) * r[2] + S(C13) * r[3]) + S(C23) * r[2] * r[3];
    return high_of(own + 2 * pairs, 0);
}

static void detect(int n, int i, const hand_real *g, hand_real *s, hand_real balance, hand_real variance, int opens,
                   int lags, hand_real dt)
{
    if (balance < 0 && S(PHI_2) > G(LOW) + HAND_C_MARGIN) {
        const hand_real most = HAND_C_MOST_RESIDUAL * G(RESIDUAL_STD);
        S(MISFIT) += dt / (dt + HAND_C_MISFIT_TIME) * (low_of(balance * balance, most * most) - S(MISFIT));
    }
    const hand_real z = (balance - S(BIAS)) / root(variance);
    S(AGE) = S(SUM) > 0 || S(CONTACT) != 0 ? S(AGE) + dt : 0;
    const hand_real weight = dt / (2 * G(OBSERVER_FILTER));
    hand_real gain = (z - (lags ? HAND_C_ALLOWANCE : HAND_C_FREE_ALLOWANCE)) * weight;
    if (opens && S(CONTACT) == 0) gain = low_of(gain, 0);
    S(SUM) = bounded(S(SUM) + gain, 0, 2 * G(THRESHOLD));
    if (S(CONTACT) == 0) {
        if (S(SUM) > G(THRESHOLD)) {
            S(CONTACT) = 1;
            S(RELEASED) = 0;
        } else if (S(SUM) < R(0.5) * G(THRESHOLD) && !(lags && balance > S(BIAS))) {
            S(BIAS) += dt / (dt + HAND_C_BIAS_TIME) * (balance - S(BIAS));
        }
        return;
    }
    S(RELEASED) = z < HAND_C_RELEASE ? S(RELEASED) + dt : 0;
    if (S(RELEASED) > HAND_C_RELEASE_TIME) S(CONTACT) = S(SUM) = S(AGE) = 0;
}

/* Whether the map changed. */
static int adapt(int n, int i, const hand_real *g, hand_real *s, hand_real balance, hand_real variance, hand_real speed,
                 int saturated, hand_real dt)
{
    static const int row[4][4] = {{HAND_S_C00, HAND_S_C01, HAND_S_C02, HAND_S_C03},
                                  {HAND_S_C01, HAND_S_C11, HAND_S_C12, HAND_S_C13},
                                  {HAND_S_C02, HAND_S_C12, HAND_S_C22, HAND_S_C23},
                                  {HAND_S_C03, HAND_S_C13, HAND_S_C23, HAND_S_C33}};
    const hand_real phi = S(PHI_2);
    const int stopped = speed > HAND_C_MIN_SPEED && S(SPEED) < HAND_C_STOPPING * speed;
    if (stopped || saturated || S(CONTACT) != 0 || S(SUM) > R(0.5) * G(THRESHOLD)) S(PAUSE) = HAND_C_PAUSE_TIME;
    else if (S(PAUSE) > 0) S(PAUSE) -= dt;
    if (balance > 0 && balance * balance > HAND_C_GATE * HAND_C_GATE * variance) return 0;
    if (S(PAUSE) > 0 || size_of(speed) < HAND_C_MIN_SPEED) return 0;
    if (phi < G(LOW) + HAND_C_MARGIN || phi > G(HIGH) - HAND_C_MARGIN) return 0;
    hand_real r[4], k[4];
    regressors(n, i, g, s, speed, r);
    for (int a = 0; a < 4; a++) {
        k[a] = s[row[a][0] * n + i] * r[0] + s[row[a][1] * n + i] * r[1] + s[row[a][2] * n + i] * r[2]
             + s[row[a][3] * n + i] * r[3];
    }
    const hand_real noise = HAND_C_BALANCE_STD * HAND_C_BALANCE_STD * (1 + 2 * G(OBSERVER_FILTER) / dt);
    const hand_real per = 1 / (noise + r[0] * k[0] + r[1] * k[1] + r[2] * k[2] + r[3] * k[3]);
    const hand_real low = 1 / G(ADAPT_BOUND) - 1, high = G(ADAPT_BOUND) - 1;
    hand_real most = high;
    if (G(A3) < 0) most = low_of(high, high_of(-HAND_C_LEVERAGE_SHARE * G(A2) / (G(A3) * G(HIGH)) - 1, 0));
    hand_real trace = 0;
    for (int a = 0; a < 4; a++) {
        for (int b = a; b < 4; b++) s[row[a][b] * n + i] -= k[a] * k[b] * per;
        if (a > 0) trace += s[row[a][a] * n + i];
    }
    /* Where the bound of a3 holds it back, the others take their most likely values given that bound. */
    const hand_real excess =
        high_of(S(D_A3) - k[2] * per * balance - most, 0) / high_of(S(C22), HAND_C_LEAST_VARIANCE);
    for (int a = 0; a < 4; a++) {
        hand_real *change = &s[(HAND_S_OFFSET + a) * n + i];
        const hand_real after = *change - k[a] * per * balance - s[row[a][2] * n + i] * excess;
        if (a == 0) *change = bounded(after, -HAND_C_MOST_LOAD, HAND_C_MOST_LOAD);
        else *change = bounded(after, low, a == 2 ? most : high);
    }
    S(C00) = low_of(S(C00) + HAND_C_LOAD_DRIFT * HAND_C_LOAD_DRIFT * dt, G(LOAD_STD) * G(LOAD_STD));
    if (trace < 3 * (1 + HAND_C_COMMON) * G(MAP_UNCERTAINTY) * G(MAP_UNCERTAINTY)) {
        const hand_real grow = 1 + dt / G(MEMORY);
        for (int a = 0; a < 10; a++) s[(HAND_S_C00 + a) * n + i] *= grow;
    }
    return 1;
}

/* At rest, the load follows a negative balance, which no obstacle causes; whether it changed. */
static int learn_at_rest(int n, int i, const hand_real *g, hand_real *s, hand_real balance, hand_real dt)
{
    const hand_real excess = balance + G(RESIDUAL_STD) + S(SPREAD);
    if (excess >= 0 || S(STOOD) < HAND_C_STAND_TIME || S(CONTACT) != 0 || G(TORQUE_MODE) != 0) return 0;
    if (S(PHI_2) < G(LOW) + HAND_C_MARGIN) return 0;
    S(OFFSET) = low_of(S(OFFSET) - dt / (dt + HAND_C_STILL_TIME) * excess, HAND_C_MOST_LOAD);
    S(C00) = high_of(S(C00), G(RESIDUAL_STD) * G(RESIDUAL_STD));
    return 1;
}

/* Torque that a joint keeps back at an object, because its partner may meet one, too. */
static hand_real partner_impact(int n, int i, const hand_real *g, const hand_real *s, const hand_real *u)
{
    const int partner = (int)G(PARTNER);
    if (partner < 0 || s[HAND_S_CONTACT * n + partner] != 0 || follows(U(SPEED), S(SPEED))) return 0;
    const hand_real speed = u[HAND_U_SPEED * n + partner], inertia = g[HAND_G_INERTIA * n + partner];
    if (speed <= 0 || inertia <= 0 || U(LIMIT) <= 0) return 0;
    const hand_real added = G(COUPLING) * speed * root(g[HAND_G_CONTACT_STIFFNESS * n + partner] / inertia);
    return low_of(added, HAND_C_MOST_IMPACT * U(LIMIT));
}

static hand_real cut(int n, int i, const hand_real *g, const hand_real *s, hand_real wanted, hand_real ceiling,
                     int rests, hand_real dt)
{
    hand_real command = low_of(high_of(wanted, 0), ceiling);
    const hand_real last = low_of(S(COMMAND), ceiling);
    command = bounded(command, last - G(P_RATE) * dt, last + G(P_RATE) * dt);
    if (rests && size_of(command - last) < G(DEADBAND) && command > 0 && command < ceiling) command = last;
    return command;
}

void hand_law_start(int n, const hand_real *g, hand_real *s)
{
    for (int k = 0; k < HAND_STATES * n; k++) s[k] = 0;
    for (int i = 0; i < n; i++) {
        S(MISFIT) = G(RESIDUAL_STD) * G(RESIDUAL_STD) / HAND_C_RESIDUAL_FACTOR;
        reset_covariance(n, i, g, s);
    }
}

void hand_law_release(int n, hand_real *s)
{
    for (int i = 0; i < n; i++) {
        S(INTEGRAL) = S(FREE_INTEGRAL) = S(COMMAND) = S(TAKE_OVER) = S(WANTED) = 0;
        S(STOOD) = S(STOOD_ERROR) = 0;
        S(PEAK) = S(LAST_PEAK) = S(SWING_TIME) = S(SLOWER) = 0;
    }
}

static hand_real feed_forward(int n, int i, const hand_real *g, const hand_real *s, const hand_real *u, hand_real a0,
                              hand_real a1, hand_real a2, hand_real a3, hand_real d)
{
    const hand_real at = low_of(U(REFERENCE), G(HIGH)), lead = G(VALVE_LAG) + G(DEAD_TIME);
    const hand_real hold = pressure_for(-S(AHEAD), at, S(CREEP), a0, a1, a2, a3, G(PHI_MAX));
    const hand_real k = -stiffness_of(hold, a1, a3), moving = (d + lead * k) * U(SPEED);
    const hand_real mass = G(INERTIA) + d * lead + k * G(LEAD_2);
    return hold + (moving + mass * U(ACCELERATION)) / leverage(at, a2, a3);
}

/* Pressure of feed-forward and integral with the present map. */
static hand_real steady_pressure(int n, int i, const hand_real *g, const hand_real *s, const hand_real *u)
{
    const hand_real a0 = G(A0) + S(OFFSET), a1 = G(A1) * (1 + S(D_A1)), a2 = G(A2);
    const hand_real a3 = G(A3) * (1 + S(D_A3)), d = G(VISCOUS) * (1 + S(D_VISCOUS));
    const hand_real here = high_of(leverage(low_of(U(POSITION), G(HIGH)), a2, a3), HAND_C_MIN_LEVERAGE);
    return feed_forward(n, i, g, s, u, a0, a1, a2, a3, d) + S(INTEGRAL) / here;
}

/* With a slow reference, the integral takes over a change of the map; before: the steady pressure with the old one. */
static void take_over_map(int n, int i, const hand_real *g, hand_real *s, const hand_real *u, hand_real before)
{
    if (G(FEED_FORWARD) == 0 || G(TORQUE_MODE) != 0 || size_of(U(SPEED)) >= HAND_C_MIN_SPEED) return;
    const hand_real a3 = G(A3) * (1 + S(D_A3));
    const hand_real here = high_of(leverage(low_of(U(POSITION), G(HIGH)), G(A2), a3), HAND_C_MIN_LEVERAGE);
    const hand_real difference = (before - steady_pressure(n, i, g, s, u)) * here;
    if (!finite_real(difference)) return;
    S(INTEGRAL) = bounded(S(INTEGRAL) + difference, -G(I_MAX), G(I_MAX));
    S(FREE_INTEGRAL) = bounded(S(FREE_INTEGRAL) + difference, -G(I_MAX), G(I_MAX));
    S(STOOD_INTEGRAL) += difference;
}

/* Drop what the integral gained in contact, once the reference retreats. */
static void let_go(int n, int i, hand_real *s, hand_real reference_speed)
{
    if (S(CONTACT) == 0 && S(SUM) == 0) S(FREE_INTEGRAL) = S(INTEGRAL);
    else if (reference_speed < -HAND_C_REST_REFERENCE) S(INTEGRAL) = low_of(S(INTEGRAL), S(FREE_INTEGRAL));
}

/* Learn the error that friction leaves at rest: that after a slip past the reference. A slip takes from the integral. */
static void watch_slips(int n, int i, const hand_real *g, hand_real *s, hand_real error, hand_real speed, int rests,
                        hand_real dt)
{
    const hand_real stood = S(STOOD);
    S(KEPT_ERROR) -= S(KEPT_ERROR) * dt / (dt + G(MEMORY));
    if (!rests) {
        S(STOOD_ERROR) = S(STOOD) = 0;
        return;
    }
    S(STOOD) = size_of(speed) < HAND_C_SLIP_SPEED ? stood + dt : 0;
    if (S(STOOD) < HAND_C_STAND_TIME) {
        if (stood >= HAND_C_STAND_TIME && speed * error > 0 && S(CONTACT) == 0)
            S(INTEGRAL) -= HAND_C_GIVEN_BACK * (S(INTEGRAL) - S(STOOD_INTEGRAL));
        return;
    }
    if (stood < HAND_C_STAND_TIME) S(STOOD_INTEGRAL) = S(INTEGRAL);
    if (stood < HAND_C_STAND_TIME && S(STOOD_ERROR) * error < 0) {
        const hand_real left = high_of(R(0.5) * size_of(error - S(STOOD_ERROR)), size_of(error));
        S(KEPT_ERROR) = high_of(S(KEPT_ERROR), low_of(left, HAND_C_MOST_KEPT));
    }
    S(STOOD_ERROR) = error;
}

/* Lengthen the response time of a joint whose error at rest swings without shrinking. */
static void watch_swings(int n, int i, const hand_real *g, hand_real *s, hand_real error, int rests, hand_real dt)
{
    if (!rests || S(CONTACT) != 0) {
        S(PEAK) = S(LAST_PEAK) = S(SWING_TIME) = 0;
        return;
    }
    S(SWING_TIME) += dt;
    if (S(PEAK) * error >= 0) {
        if (size_of(error) > size_of(S(PEAK))) S(PEAK) = error;
        return;
    }
    const hand_real before = size_of(S(LAST_PEAK)), peak = size_of(S(PEAK));
    if (peak > HAND_C_SWING_ERROR && S(SWING_TIME) < HAND_C_SWING_HALF) {
        if (before > 0 && peak > HAND_C_SWING_DECAY * before) {
            const hand_real step = HAND_C_SWING_STEP * (G(RESPONSE_TIME) + G(DEAD_TIME) + S(SLOWER));
            S(SLOWER) = low_of(S(SLOWER) + step, HAND_C_MOST_SLOWER * G(RESPONSE_TIME));
        }
        S(LAST_PEAK) = peak;
    } else if (peak > HAND_C_NOISE) {
        S(LAST_PEAK) = 0;
    }
    S(PEAK) = error;
    S(SWING_TIME) = 0;
}

static void integrate_error(int n, int i, const hand_real *g, hand_real *s, hand_real ki, hand_real error,
                            hand_real beyond, hand_real here, hand_real stiffness, int rests, hand_real dt)
{
    if (rests && G(DEADBAND) > 0 && stiffness > 0) {
        if (size_of(error) <= high_of(G(DEADBAND) * here / stiffness, S(KEPT_ERROR)) + HAND_C_NOISE) return;
        if (S(STOOD) >= HAND_C_STAND_TIME && S(CONTACT) == 0 && size_of(error) > HAND_C_STUCK_ERROR)
            ki *= HAND_C_STUCK_GAIN;
    }
    hand_real growth = ki * error;
    if (G(BACK_CALCULATION) != 0) growth -= beyond * here / G(TRACKING_TIME);
    else if (beyond * error > 0) growth = 0;
    S(INTEGRAL) = bounded(S(INTEGRAL) + growth * dt, -G(I_MAX), G(I_MAX));
}

static void hold_command(int n, int i, const hand_real *s, hand_real *out)
{
    OUT(PRESSURE) = S(COMMAND);
    OUT(SATURATED) = 0;
}

static void joint(int n, int i, const hand_real *g, hand_real *s, const hand_real *u, hand_real dt, int integrate,
                  int drive, hand_real *out)
{
    const hand_real phi = U(POSITION), p = U(PRESSURE);
    if (!finite_real(phi + p + U(REFERENCE) + U(SPEED) + U(ACCELERATION) + U(LIMIT))) {
        hold_command(n, i, s, out);
        return;
    }
    observe(n, i, g, s, phi, p, dt);
    const hand_real a0 = G(A0) + S(OFFSET), a1 = G(A1) * (1 + S(D_A1)), a2 = G(A2);
    const hand_real a3 = G(A3) * (1 + S(D_A3)), d = G(VISCOUS) * (1 + S(D_VISCOUS));
    const hand_real creep = S(CREEP), phi_max = G(PHI_MAX);
    OUT(TORQUE) = (torque(p, phi, creep, a0, a1, a2, a3, phi_max) + S(LOAD)) * torque_scale(n, i, s);
    const hand_real speed_2 = (S(PHI_1) - S(PHI_2)) / G(OBSERVER_FILTER);
    const int partner = (int)G(PARTNER);
    hand_real inertial = G(INERTIA) * S(ACCELERATION);
    if (partner >= 0) inertial += G(COUPLING) * s[HAND_S_ACCELERATION * n + partner];
    const hand_real product = S(Q_2) - S(P_2) * S(PHI_2);
    const hand_real balance =
        torque(S(P_2), S(PHI_2), creep, a0, a1, a2, a3, phi_max) + a3 * product + S(FOUND_2) - d * speed_2 - inertial;
    const hand_real share = G(MAP_ERROR) * a2 * S(P_2);
    const hand_real least = HAND_C_LEAST_RESIDUAL * G(RESIDUAL_STD);
    hand_real variance = high_of(HAND_C_RESIDUAL_FACTOR * S(MISFIT), least * least) + share * share
                       + S(SPREAD) * S(SPREAD);
    if (G(ADAPT) != 0) variance += map_variance(n, i, g, s, speed_2);
    if (G(DETECT) != 0) {
        const int moves = follows(U(SPEED), S(SPEED));
        detect(n, i, g, s, balance, variance, moves && U(SPEED) < 0, !moves && U(SPEED) > HAND_C_MOVING_SPEED, dt);
        if (contradicted_by_motion(n, i, s, U(SPEED), dt)) reset_covariance(n, i, g, s);
    }
    OUT(CONTACT) = S(CONTACT);
    OUT(CONTACT_AGE) = S(AGE);
    OUT(CONTACT_TORQUE) = balance;
    if (!drive) {
        OUT(PRESSURE) = OUT(SATURATED) = 0;
        return;
    }
    const hand_real lag = G(VALVE_LAG), at_phi = low_of(phi, G(HIGH)), stiffness = -stiffness_of(p, a1, a3);
    const hand_real here = high_of(leverage(at_phi, a2, a3), HAND_C_MIN_LEVERAGE);
    hand_real kp = G(KP), ki = G(KI), kd = G(KD), error = 0;
    if (G(SCHEDULE) != 0) {
        const hand_real per = 1 / (G(RESPONSE_TIME) + G(DEAD_TIME) + S(SLOWER));
        kp = (d + stiffness * lag) * per;
        ki = stiffness * per;
        kd = (d * lag + G(INERTIA)) * per;
    }
    const hand_real kept = G(TORQUE_MODE) == 0 ? partner_impact(n, i, g, s, u) : 0;
    const hand_real largest = (U(LIMIT) - kept) / torque_scale(n, i, s) - S(LOAD);
    hand_real ceiling = pressure_for(largest, at_phi, creep, a0, a1, a2, a3, phi_max), wanted = ceiling;
    if (G(TORQUE_MODE) == 0) {
        error = U(REFERENCE) - phi;
        let_go(n, i, s, U(SPEED));
        wanted = G(FEED_FORWARD) != 0 ? feed_forward(n, i, g, s, u, a0, a1, a2, a3, d) : 0;
        wanted += (kp * error + kd * (U(SPEED) - S(SPEED))) / here;
        if (S(TAKE_OVER) != 0) {
            S(TAKE_OVER) = S(STOOD) = 0;
            S(INTEGRAL) = bounded((S(COMMAND) - wanted) * here, -G(I_MAX), G(I_MAX));
        }
        wanted += S(INTEGRAL) / here;
    }
    ceiling = low_of(high_of(ceiling, 0), G(P_MAX));
    if (G(TORQUE_MODE) != 0 && !(U(LIMIT) > 0)) wanted = ceiling = low_of(ceiling, S(COMMAND));
    if (!finite_real(wanted + ceiling)) {
        hold_command(n, i, s, out);
        return;
    }
    const int rests = G(TORQUE_MODE) != 0 ? size_of(S(SPEED)) < HAND_C_REST_SPEED
                                          : size_of(U(SPEED)) < HAND_C_REST_REFERENCE;
    const int filtered = rests && size_of(error) < HAND_C_REST_ERROR && G(DEADBAND) > 0 && dt > 0;
    watch_slips(n, i, g, s, error, speed_2, rests, dt);
    if (G(SCHEDULE) != 0 && G(TORQUE_MODE) == 0) watch_swings(n, i, g, s, error, rests, dt);
    S(WANTED) += (filtered ? dt / (dt + HAND_C_REST_FILTER) : 1) * (wanted - S(WANTED));
    const hand_real beyond = wanted - bounded(wanted, 0, ceiling);
    S(COMMAND) = cut(n, i, g, s, S(WANTED), ceiling, rests, dt);
    if (integrate) integrate_error(n, i, g, s, ki, error, beyond, here, stiffness, rests, dt);
    OUT(PRESSURE) = S(COMMAND);
    OUT(SATURATED) = beyond != 0;
    if (G(ADAPT) != 0 && dt > 0 && integrate) {
        const hand_real before = steady_pressure(n, i, g, s, u);
        const int changed = adapt(n, i, g, s, balance, variance, speed_2, beyond != 0, dt)
                         || learn_at_rest(n, i, g, s, balance, dt);
        if (changed && beyond == 0) take_over_map(n, i, g, s, u, before);
    }
}

void hand_law_tick(int n, const hand_real *g, hand_real *s, const hand_real *u, hand_real dt, int integrate, int drive,
                   hand_real *out)
{
    const hand_real step = dt >= HAND_C_MIN_DT && finite_real(dt) ? low_of(dt, HAND_C_MAX_DT) : 0;
    for (int i = 0; i < n; i++) joint(n, i, g, s, u, step, integrate, drive, out);
}
