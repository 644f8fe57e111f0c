/* The control law of every joint, for a microcontroller: C99, no library but the compiler's own arithmetic and sqrt.
 *
 * It is the law of hand_control/law.py, adapt.py and contact.py, whose docstrings give equations and sources; a test
 * runs both on the same recorded inputs. Arrays are row-major: row r of joint i is a[r * joints + i]. All values are
 * SI, pressures gauge. HAND_REAL is float unless defined otherwise.
 */
#ifndef HAND_LAW_H
#define HAND_LAW_H

#ifndef HAND_REAL
#define HAND_REAL float
#endif
typedef HAND_REAL hand_real;

/* Rows of the gains: the model of each joint, the tuning, and a switch (0 or 1) for every part. */
enum {
    HAND_G_A0, HAND_G_A1, HAND_G_A2, HAND_G_A3, HAND_G_PHI_MAX, HAND_G_P_MIN, HAND_G_B1, HAND_G_EXTENSION_RATE,
    HAND_G_B0, HAND_G_RECOVERY_RATE, HAND_G_INERTIA, HAND_G_VISCOUS, HAND_G_COUPLING, HAND_G_PARTNER,
    HAND_G_VALVE_LAG, HAND_G_DEAD_TIME, HAND_G_LOW, HAND_G_HIGH, HAND_G_P_MAX, HAND_G_KP, HAND_G_KI, HAND_G_KD,
    HAND_G_I_MAX, HAND_G_SPEED_FILTER, HAND_G_OBSERVER_FILTER, HAND_G_P_RATE, HAND_G_DEADBAND,
    HAND_G_TRACKING_TIME, HAND_G_RESPONSE_TIME, HAND_G_MEMORY, HAND_G_ADAPT_BOUND, HAND_G_MAP_UNCERTAINTY,
    HAND_G_RESIDUAL_STD, HAND_G_MAP_ERROR, HAND_G_THRESHOLD, HAND_G_BACK_CALCULATION, HAND_G_FEED_FORWARD, HAND_G_CREEP,
    HAND_G_SCHEDULE, HAND_G_ADAPT, HAND_G_DETECT, HAND_G_TORQUE_MODE, HAND_GAINS
};

/* Rows of the state. */
enum {
    HAND_S_INTEGRAL, HAND_S_COMMAND, HAND_S_FRESH, HAND_S_CREEP, HAND_S_LAST, HAND_S_SPEED, HAND_S_PHI_1,
    HAND_S_PHI_2, HAND_S_P_1, HAND_S_P_2, HAND_S_Q_1, HAND_S_Q_2, HAND_S_ACCELERATION, HAND_S_D_A0, HAND_S_D_A1,
    HAND_S_D_A3, HAND_S_D_VISCOUS, HAND_S_C00, HAND_S_C01, HAND_S_C02, HAND_S_C03, HAND_S_C11, HAND_S_C12,
    HAND_S_C13, HAND_S_C22, HAND_S_C23, HAND_S_C33, HAND_S_BIAS, HAND_S_SUM, HAND_S_AGE, HAND_S_CONTACT,
    HAND_S_QUIET, HAND_S_STARTED, HAND_S_BLIND, HAND_S_MOVING, HAND_S_CALM, HAND_STATES
};

/* Rows of the output: command [Pa], torque [N m], 1 where cut, 1 in contact, its torque [N m], its age [s]. */
enum {
    HAND_O_PRESSURE, HAND_O_TORQUE, HAND_O_SATURATED, HAND_O_CONTACT, HAND_O_CONTACT_TORQUE, HAND_O_CONTACT_AGE, HAND_OUTPUTS
};

/* Begin released, with a rested material and the identified map: s is HAND_STATES x joints. */
void hand_law_start(int joints, const hand_real *g, hand_real *s);

/* Forget what drove the joints, as a vent does: integrators and commands to 0. */
void hand_law_release(int joints, hand_real *s);

/* One tick of every joint. reference [rad], its speed [rad/s] and acceleration [rad/s^2], limit [N m], position [rad],
 * pressure [Pa]: (joints). dt [s]. integrate: 0 freezes the integrators. drive: 0 observes only, and out is 0 Pa.
 * Not a number in any input: that joint keeps its last command. */
void hand_law_tick(int joints, const hand_real *g, hand_real *s, const hand_real *reference, const hand_real *speed,
                   const hand_real *acceleration, const hand_real *limit, const hand_real *position,
                   const hand_real *pressure, hand_real dt, int integrate, int drive, hand_real *out);

#endif
