#ifndef KN_CLIENTS_BUZZ_H
#define KN_CLIENTS_BUZZ_H
// Root mean square of the part of a signal above 10 Hz, which a fingertip feels as a buzz. The filter is a second-order
// Butterworth high-pass (bilinear transform, at the given sampling rate). The sum of squares of the filtered signal
// starts at the last reset. Apply the filter to the force and not to the position: a chatter at 500 Hz has an amplitude
// of micrometres only.
#define KN_BUZZ_HZ 10.0

// High-pass filter with a sum of squares; callers use the functions below and do not write the fields.
typedef struct kn_buzz {
    double b, a1, a2; // filter coefficients: y = b (x - 2 x1 + x2) - a1 y1 - a2 y2, input x, output y
    double x1, x2, y1, y2;
    double sum;
    long count;
} kn_buzz;

// Start the high-pass filter. `first` is the value of the signal up to now, so that a constant signal counts as no
// buzz.
void kn_buzz_init(kn_buzz *buzz, double period_s, double first);
void kn_buzz_add(kn_buzz *buzz, double value);
// Clear the sum of squares, but keep the state of the high-pass filter.
void kn_buzz_reset(kn_buzz *buzz);
// Return the root mean square of the filtered signal since the last reset, or 0 if no value was added.
double kn_buzz_rms(const kn_buzz *buzz);

// Number of times that a signal turns round by more than a hysteresis. A step or a stroke gives one or two turns; a
// buzz gives many. A signal that turns 20 times a second oscillates at 10 Hz.
typedef struct kn_turns {
    double hysteresis, extreme; // hysteresis, > 0; extreme value of the signal since the last turn
    int up;                     // direction in which the signal moves, 1 or -1; 0: not known yet
    int count;
} kn_turns;
void kn_turns_add(kn_turns *turns, double value);

#endif
