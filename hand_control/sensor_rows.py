"""Rows of the table of `sensor_watch.check_sensors`: state, constants of each joint, state of the places."""

A, B, C, X, Z, V, PRED, DEV, TRAVEL, JERK, NOISE = range(11)
"""Of the step test: samples z, a, b, c, x; what is computed of them; mean second difference [rad]."""
LAST, RUN, RUN_SPEED, SPEED, OUT_S, ACTIVE_S, PAUSE, HOLD, BELIEVED_PA = range(11, 20)
"""Of channel and passivity: last angle, run of equal readings and the speed at its begin, speed, times; of the hold."""
FROM, MODEL, W, U, DOUBTED, SIGN_S, BIAS = range(20, 27)
"""Of the first motion: angle before, angle asked for, recent motions asked for and measured; whether the
sign may be wrong."""
PE, PX, PSWAP_S, P_PROVEN, P_LAST, P_SLOW = range(27, 33)
"""Of the pressures: errors as wired and exchanged, times, last pressure, slow pressure."""
P_B, P_C, P_X, P_E, DRIVE = range(33, 38)
"""Pressures at the last samples of the step test, and the driving pressure of the last frame."""
EXACT_S, STORED_J = 38, 39
"""Of the pressures: for how long each is exactly that of the other joint. Of passivity: energy in an obstacle."""
ROWS = 40
A0, A1, A2, A3, J, D, JC, LOW, HIGH, MIRROR, PRESSED = range(11)
"""Constants: Eqs. 6 and 8, end stops, twice the centre of the sensor, how far a push presses a stop."""
PLACES = ROWS + 11
"""First row of the place watch."""
