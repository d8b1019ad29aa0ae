#ifndef KN_SERVER_BACKEND_LINK_H
#define KN_SERVER_BACKEND_LINK_H
// A link to a circuit's registers. The link carries a request (frame.h) to the circuit and the reply back, over a
// serial line or through memory that both sides can access. circuit_device.h builds and interprets the requests.
//
//     uart:/dev/ttyUSB0?baud=3000000   frames on a serial line (default 3000000)
//     pty:/dev/pts/7                   the same, on a pseudo-terminal
//     pcie:0000:01:00.0                BAR 0 of a PCI function: by vfio-pci if the function is bound to it, otherwise
//                                      by its resource0 in sysfs
//     shm:NAME                         the same words in /dev/shm/NAME, which knead-simdev --bar NAME serves
//
// Options follow a '?', separated by '&':
//     miss=MS                     time until an unanswered request is sent again, ms (default 1.6, range 0.1 .. 60000)
//     shadow=full|checked|off     of the ticks that the circuit computes, this processor computes all as well, one in
//                                 50, or none (default full)
//     lost=stop|go-on             with checked or off, while the circuit is lost: stop, the object stands still; go-on,
//                                 this processor computes it (default stop)
//
// One request is under way at a time. A new request replaces it, and the reply to the old request is dropped when it
// arrives. No function waits beyond its deadline, and only open allocates. submit and wait on a line are real-time safe
// as far as read, write and ppoll of that line are; on shared memory, submit and wait make no system call but to sleep.
// For a card, submit also reads a file that never blocks. Not thread-safe.
#include "server/backend/frame.h"

typedef enum kn_shadow { KN_SHADOW_FULL, KN_SHADOW_CHECKED, KN_SHADOW_OFF } kn_shadow;

#define KN_LINK_URI 256 // largest length of a URI, characters
#define KN_LINK_WHY 384
#define KN_LINK_CARD 64

typedef enum kn_link_status {
    KN_LINK_OK,
    KN_LINK_LATE,     // no answer by the deadline; an answer may still arrive later
    KN_LINK_CRC,      // an answer arrived damaged; the request may be sent again at once
    KN_LINK_PROTOCOL, // an answer arrived that a correct circuit never gives
    KN_LINK_IO,       // the kernel reported an error, or there was no answer at all
    // The line hung up, the ID register reads as all ones, or an operator removes the card. The link must be closed, for
    // which the kernel waits before it removes the card, and opened again.
    KN_LINK_GONE
} kn_link_status;

const char *kn_link_words(kn_link_status status); // return the status in words: "late", "wrong checksum", ...

typedef struct kn_link_counts {
    // Numbers of frames dropped: wrong checksum; wrong COBS coding or length; good frame, but no reply to the present
    // request.
    int64_t crc, coding, stray;
} kn_link_counts;

typedef struct kn_link {
    kn_shadow shadow;             // option ?shadow
    bool goes_on;                 // option ?lost=go-on
    int64_t miss_ns;              // time until an unanswered request is sent again (option ?miss), ns
    int64_t byte_ns;              // time of one byte on the serial line, ns; 0: the link is no serial line
    bool isolated;                // true: opened by vfio-pci; kn_link_open then never opens this card by sysfs
    const char *notice;           // one line on what this way to the card costs; NULL: none
    const kn_link_counts *counts; // valid until the link is closed; NULL: memory, which has no frames
    void *self;
    kn_link_status (*submit)(void *self, const kn_request *request); // send a request, which is copied
    // Wait for the reply until deadline_ns of CLOCK_MONOTONIC; if the deadline has passed, check once. Return LATE as
    // well if no request is under way.
    kn_link_status (*wait)(void *self, int64_t deadline_ns, kn_reply *reply);
    bool (*gone)(void *self);   // return true if the device is being removed; NULL: only a request shows that
    void (*forget)(void *self); // drop the request under way and all input received so far
    void (*close)(void *self);
} kn_link;

// Return true if uri is a valid URI, whether or not it exists; otherwise `why` says what was expected.
bool kn_link_is_uri(const char *uri, char why[KN_LINK_WHY]);

// Open a link. `link` is zero, or was closed and is opened again. Return false on failure; `why` is then one line that
// says what is wrong and, if the URI is invalid, what was expected. A file is opened for this process alone.
// `sysfs`: path of sysfs, normally "/sys".
bool kn_link_open(kn_link *link, const char *uri, const char *sysfs, char why[KN_LINK_WHY]);

bool kn_link_is_baud(int baud, char why[KN_LINK_WHY]); // return true if a serial line can have this baud rate
// Open the serial line `path` for this process alone, in raw mode, and let a USB adapter pass on each byte at once.
// `baud` 0: a pseudo-terminal, which has no baud rate. Return the descriptor, or -1 with errno set: EBUSY, another
// program has opened the line; ENOTTY, `path` is no serial line.
int kn_link_line(const char *path, int baud, const char *sysfs);

bool kn_link_is_function(const char *s); // return true for the address of a PCI function, DDDD:BB:DD.F
// Get the driver and the IOMMU group of a PCI function, "" if it has none. Return true if it can be opened by vfio-pci.
bool kn_link_vfio(const char *sysfs, const char *function, char driver[KN_LINK_CARD], char group[KN_LINK_CARD]);

// ---- private: one function per transport; path and options have been checked
bool kn_link_uart(kn_link *link, const char *path, int baud, const char *sysfs, char why[KN_LINK_WHY]);
bool kn_link_pcie(kn_link *link, const char *function, const char *sysfs, char why[KN_LINK_WHY]);
bool kn_link_shm(kn_link *link, const char *name, char why[KN_LINK_WHY]);

// ---- the file of shm: 2^24 words, then a doorbell
//
// A plain store into memory cannot trigger anything, so words whose writing has an effect (CONTROL, STATUS, FLAGS,
// STEP_SEQ) go through the doorbell. The host puts them into bell_address and bell_word, then increments bell. Until
// the device has counted done up to bell, STATUS reads as busy. Each side polls the other's count; neither wakes the
// other.
#define KN_SHM_WORDS (1u << 24)
#define KN_SHM_BYTES (4u * KN_SHM_WORDS + 4096u)

typedef struct kn_shm {
    uint32_t bell, bell_address, bell_word, done;
} kn_shm;

static inline kn_shm *kn_shm_of(void *file) { return (kn_shm *)((uint8_t *)file + 4u * KN_SHM_WORDS); }

#endif
