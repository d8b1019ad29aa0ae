#ifndef KN_CORE_SDIRK_H
#define KN_CORE_SDIRK_H
// Coefficients of the L-stable singly diagonally implicit Runge-Kutta method of order 4 in Hairer and Wanner, Solving
// ODEs II, table IV.6.5. The method is stiffly accurate: its last stage is the result of the step. The header is for
// sources that integrate springs and dampers; every such source includes it once.
//
// Division by KN_SDIRK_GAMMA is exact. If a stage yields D = KN_SDIRK_GAMMA h times the rate, then row[j][m] / GAMMA * D is the
// part of stage m in stage j.
#define KN_SDIRK_STAGES 5
#define KN_SDIRK_GAMMA 0.25 // diagonal of the method

static const double kn_sdirk_time[KN_SDIRK_STAGES] = {1. / 4, 3. / 4, 11. / 20, 1. / 2, 1}; // times of the stages, in h
static const double kn_sdirk_row[KN_SDIRK_STAGES][KN_SDIRK_STAGES] = {{0},
                                                                      {1. / 2},
                                                                      {17. / 50, -1. / 25},
                                                                      {371. / 1360, -137. / 2720, 15. / 544},
                                                                      {25. / 24, -49. / 48, 125. / 16, -85. / 12}};
// embedded error estimate: the solution of order 4 minus that of order 3
static const double kn_sdirk_error[KN_SDIRK_STAGES] = {-3. / 16, -27. / 32, 25. / 32, 0, 1. / 4};

#endif
