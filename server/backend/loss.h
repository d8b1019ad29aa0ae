#ifndef KN_SERVER_BACKEND_LOSS_H
#define KN_SERVER_BACKEND_LOSS_H
// Reasons why a circuit is not in step, by name. kneadd's log line, its status and its counters use the same word.
// Append only: health_t holds the indices.
#include <stdint.h>

// name, its word, its meaning
#define KN_LOSSES(LOSS)                                                                                                \
    LOSS(TIMEOUT, timeout, "a request, sent three times, was not answered")                                            \
    LOSS(CRC, crc, "frames arrived broken again and again")                                                            \
    LOSS(REMOVED, removed, "no circuit is there: a hang-up, all ones for registers, or nothing to open")               \
    LOSS(IO, io, "the kernel refused to read or to write")                                                             \
    LOSS(REFUSED, refused, "requests were answered with an error")                                                     \
    LOSS(WRONG_HASH, wrong_hash, "no circuit, or one with other formats or registers")                                 \
    LOSS(BLANK, blank, "the circuit has lost its state, as after a loss of power")                                     \
    LOSS(LOAD, load, "the circuit did not take the object, or has another than it was given")                          \
    LOSS(SEQ_GAP, seq_gap, "the circuit is at another step or tick than requested")                                    \
    LOSS(TWIN, twin, "its results differ from its twin's")                                                             \
    LOSS(SATURATED, saturated, "other numbers saturated than in its twin")                                             \
    LOSS(BEHIND, behind, "the circuit fell behind by more ticks than the queue holds")                                 \
    LOSS(BOUNDS, bounds, "more nodes under tools than the circuit takes")                                              \
    LOSS(LATE, late, "the circuit, which computes alone, gave no results in three ticks in a row, or no state")

typedef enum kn_loss {
#define KN_LOSS_NAME(name, word, what) KN_LOSS_##name,
    KN_LOSSES(KN_LOSS_NAME)
#undef KN_LOSS_NAME
        KN_LOSS_COUNT // number of reasons; also stands for no reason
} kn_loss;

const char *kn_loss_word(kn_loss loss);  // "timeout", "seq_gap", ...; "none" for KN_LOSS_COUNT
const char *kn_loss_means(kn_loss loss); // one line, without a capital or a full stop

#endif
