#ifndef KN_SERVER_BACKEND_LINK_H
#define KN_SERVER_BACKEND_LINK_H
// The way to a circuit's registers: a request of frame.h there, its reply back. What a request means is device.h's; a
// link only carries it, over a serial line or by a memory that both sides see.
//
//     uart:/dev/ttyUSB0?baud=3000000   frames on a serial line (default 3000000)
//     pty:/dev/pts/7                   the same, on a pseudo-terminal
//     pcie:0000:01:00.0                BAR 0 of a PCI function, by its resource0 in sysfs
//     shm:NAME                         the same words in /dev/shm/NAME, which knead-simdev --bar NAME serves
//
// and of each ?miss=MS: how long one request may go unanswered before it is sent again (1.6, .1 .. 60000).
//
// One request is under way at a time; another one takes its place, and the reply to the first is dropped when it comes.
// Nothing waits beyond the deadline it is given and nothing allocates but open: submit and wait are real-time safe as
// far as read, write and ppoll of that line are; over memory they sleep, and call nothing else. Not thread-safe.
#include "server/backend/frame.h"

#define KN_LINK_URI 256 // characters at most
#define KN_LINK_WHY 384

typedef enum kn_link_status {
    KN_LINK_OK,
    KN_LINK_LATE,     // no answer by the deadline; one may still come
    KN_LINK_CRC,      // something came, broken: what was asked is worth asking again at once
    KN_LINK_PROTOCOL, // an answer that the other end must not give
    KN_LINK_IO,       // the kernel says so, or nothing answers
    KN_LINK_GONE      // hang-up, or all ones where an ID should be: open it again
} kn_link_status;

const char *kn_link_words(kn_link_status status); // "late", "wrong checksum", ...

typedef struct kn_link_counts {
    int64_t sent, received;     // requests, replies to them
    int64_t crc, coding, stray; // frames dropped: checksum; COBS or length; whole, but no reply to what was asked
} kn_link_counts;

typedef struct kn_link {
    const char *name;  // "uart", "pty", "pcie", "shm"
    int64_t miss_ns;   // see ?miss
    int64_t byte_ns;   // that a byte takes on the wire; 0: no wire
    bool device_waits; // a WAIT's limit counts; else it reads until the request is dropped
    void *self;
    kn_link_status (*submit)(void *self, const kn_request *request); // copies it
    // Until its reply is there or deadline_ns of CLOCK_MONOTONIC; a deadline in the past looks once. LATE, too, when
    // nothing was asked.
    kn_link_status (*wait)(void *self, int64_t deadline_ns, kn_reply *reply);
    void (*forget)(void *self); // the request under way, and whatever has come
    void (*count)(const void *self, kn_link_counts *counts);
    void (*close)(void *self);
} kn_link;

// Whether it is written as one, whatever is there; false: why as below.
bool kn_link_is_uri(const char *uri, char why[KN_LINK_WHY]);

// False: why is one line that says what is wrong and, of an URI, what was expected. A file is opened for this process
// alone.
bool kn_link_open(kn_link *link, const char *uri, char why[KN_LINK_WHY]);
bool kn_link_open_at(kn_link *link, const char *uri, const char *sysfs, char why[KN_LINK_WHY]); // sysfs: "/sys"

// ---- private: one per transport; path and options have been checked
bool kn_link_is_baud(int baud, char why[KN_LINK_WHY]); // that a line can have
bool kn_link_uart(kn_link *link, const char *path, int baud, const char *sysfs, char why[KN_LINK_WHY]); // baud 0: pty
bool kn_link_pcie(kn_link *link, const char *function, const char *sysfs, char why[KN_LINK_WHY]);
bool kn_link_shm(kn_link *link, const char *name, char why[KN_LINK_WHY]);

// ---- the file of shm: 2^24 words, and behind them what replaces the trap that a plain store into memory has not
//
// A word whose writing does something (KN_BELLS) is put into bell_address and bell_word, then bell is counted up. Until
// the device has counted done up to it, STATUS reads as busy. Each looks at the other's count, neither wakes the other.
#define KN_SHM_WORDS (1u << 24)
#define KN_SHM_BYTES (4u * KN_SHM_WORDS + 4096u)

typedef struct kn_shm {
    uint32_t bell, bell_address, bell_word, done;
} kn_shm;

static inline kn_shm *kn_shm_of(void *file)
{
    return (kn_shm *)((uint8_t *)file + 4u * KN_SHM_WORDS);
}

#endif
