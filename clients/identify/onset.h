#ifndef KN_CLIENTS_IDENTIFY_ONSET_H
#define KN_CLIENTS_IDENTIFY_ONSET_H
// When a load came, by the strain that it made. Under a load that is held a strain is bent downwards: the straight line
// through its first readings meets the level from which it began when the load came or before that, never after it. The
// lateness that this tells is a lower limit, whatever the material, be there flat readings before the load or none.

// Where that line meets the level: 0, or the mean of the first three readings if these are flat; -INFINITY where no
// line can be told from noise. *least_s: no load came before that, by four standard deviations. Times that rise.
double kn_onset(int count, const double *time_s, const double *strain, double noise, double *least_s);

#endif
