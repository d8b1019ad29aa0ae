// A link to registers in memory: the BAR of a PCI function, or a file that a simulated device serves.
#include "core/fixed.h"
#include "hdl/registers.h"
#include "server/backend/link.h"
#include "server/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/vfio.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

// Codes of the operations; time of polling before the first sleep, ns; time of a sleep, ns; largest number of links
// that are open at once.
enum { WRITE = 2, WAIT = 3, SPIN_NS = 10000, NAP_NS = 20000, WATCHED = 4 };

// Descriptors: the file or the device with the registers; the device's IOMMU group and its container (vfio-pci); what is
// read once a request and tells that the card is removed (a card).
enum { DEVICE, GROUP, CONTAINER, REMOVAL, FDS };

typedef struct bar {
    int fd[FDS]; // -1: not open
    size_t bytes;
    uint32_t words;
    volatile uint32_t *word;
    kn_shm *shm; // doorbell of a simulated device; NULL: a real card, which notices each store
    // The request under way. `ones`: a word of all ones was read; `at`: position of the present operation; `done`:
    // number of its words that are done.
    bool asked, ones;
    size_t at, done;
    kn_request request;
    kn_reply reply;
} bar;

// ---- memory that is taken away
//
// The kernel unmaps a card that is removed, and the end of a file that is cut off. Reading there raises SIGBUS. The
// handler puts a page of all ones there, as a bus reads where nobody answers.

static struct {
    _Atomic uintptr_t from; // start of the mapping; 0: this entry is free
    _Atomic size_t bytes;
} watched[WATCHED];
static struct sigaction before; // signal handler that was installed before this module's

// Put a page of ones at the address if one of our links has it; otherwise restore the former handler.
static void on_bus_error(int number, siginfo_t *info, void *context)
{
    (void)context;
    const uintptr_t at = (uintptr_t)info->si_addr, page = at & ~(uintptr_t)4095;
    const int kept = errno;
    for (int i = 0; i < WATCHED; i++) {
        const uintptr_t from = atomic_load(&watched[i].from);
        if (from == 0 || at < from || at - from >= atomic_load(&watched[i].bytes)) continue;
        void *ones = mmap((void *)page, 4096, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0);
        if (ones == MAP_FAILED) break;
        memset(ones, 0xff, 4096);
        errno = kept;
        return;
    }
    // the address is none of our mappings, so let the fault happen again without this handler
    sigaction(number, &before, NULL);
}

static void install(void)
{
    struct sigaction action = {.sa_sigaction = on_bus_error, .sa_flags = SA_SIGINFO};
    sigaction(SIGBUS, &action, &before);
}

// Register a mapping with the handler.
static bool watch(void *at, size_t bytes)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, install);
    for (int i = 0; i < WATCHED; i++) {
        uintptr_t nobody = 0;
        if (!atomic_compare_exchange_strong(&watched[i].from, &nobody, (uintptr_t)at)) continue;
        atomic_store(&watched[i].bytes, bytes);
        return true;
    }
    errno = EMFILE;
    return false;
}

static void unwatch(void *at)
{
    for (int i = 0; i < WATCHED; i++)
        if (atomic_load(&watched[i].from) == (uintptr_t)at) {
            atomic_store(&watched[i].bytes, 0);
            atomic_store(&watched[i].from, 0);
        }
}

// ---- words
//
// Words are copied one by one, never by memcpy, because a BAR transfers 32 bits at a time, in order.

// Return true while the device has not yet handled the last doorbell.
static bool ringing(const bar *b)
{
    return b->shm &&
           __atomic_load_n(&b->shm->done, __ATOMIC_ACQUIRE) != __atomic_load_n(&b->shm->bell, __ATOMIC_RELAXED);
}

// Read a word. Note a word of all ones, the mark of a missing card. STATUS reads as busy while a doorbell has not been
// handled.
static uint32_t get(bar *b, uint32_t address)
{
    uint32_t word = b->word[address];
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    if (word == UINT32_MAX) b->ones = true;
    return address == KN_REG_STATUS && ringing(b) ? word | KN_STATUS_BUSY : word;
}

// Write a word, through the doorbell if writing it has an effect. Return false if the previous doorbell has not been
// handled yet.
static bool put(bar *b, uint32_t address, uint32_t word)
{
    kn_shm *s = b->shm;
    bool bell = s && (address == KN_REG_CONTROL || address == KN_REG_STATUS || address == KN_REG_FLAGS ||
                      address == KN_REG_STEP_SEQ);
    if (bell && ringing(b)) return false;
    __atomic_thread_fence(__ATOMIC_RELEASE);
    if (!bell) {
        b->word[address] = word;
        return true;
    }
    s->bell_address = address;
    s->bell_word = word;
    __atomic_store_n(&s->bell, s->bell + 1, __ATOMIC_RELEASE); // makes the word visible before the count
    return true;
}

// ---- operations

// Write words. Return false if the doorbell is not free; the next call continues with the same word.
static bool write_words(bar *b, const uint8_t *words, uint32_t address, uint32_t count)
{
    for (; b->done < count; b->done++)
        if (!put(b, address + (uint32_t)b->done, kn_framer_number(words + 4 * b->done, 4))) return false;
    b->done = 0;
    return true;
}

// Execute the request as far as possible. Return LATE if a WAIT has not yet read its value, or if the doorbell is not
// free. A word beyond the registers is answered with a bus error, without the operations after it.
static kn_link_status advance(bar *b)
{
    while (b->at < b->request.size) {
        const uint8_t what = b->request.bytes[b->at], *operation = b->request.bytes + b->at + 1;
        const uint32_t address = kn_framer_number(operation, 3), count = what == WAIT ? 1 : operation[3];
        uint32_t *words = b->reply.words + b->reply.count;
        if (address + count > b->words) {
            b->reply.status = KN_REPLY_BUS;
            b->at = b->request.size;
            return KN_LINK_OK;
        }
        if (what == WRITE) {
            if (!write_words(b, operation + 4, address, count)) return KN_LINK_LATE;
            b->at += 5 + 4 * (size_t)count;
            continue;
        }
        for (uint32_t i = 0; i < count; i++) words[i] = get(b, address + i);
        if (what == WAIT && (*words & kn_framer_number(operation + 3, 4)) != kn_framer_number(operation + 7, 4))
            return KN_LINK_LATE;
        b->reply.count = (uint16_t)(b->reply.count + count);
        b->at += what == WAIT ? 14 : 5;
    }
    return KN_LINK_OK;
}

// Return true if the kernel has asked for the card, or has removed it.
static bool removed(void *self)
{
    bar *b = self;
    uint64_t times; // number of times that the kernel has asked
    const ssize_t told = b->fd[REMOVAL] >= 0 ? read(b->fd[REMOVAL], &times, sizeof times) : 0;
    return told > 0 || (told < 0 && errno == ENODEV);
}

static kn_link_status submit(void *self, const kn_request *request)
{
    bar *b = self;
    if (removed(b)) return KN_LINK_GONE;
    b->request = *request;
    b->reply = (kn_reply){.tag = (uint16_t)kn_framer_number(request->bytes, 2)};
    b->asked = true;
    b->ones = false;
    b->at = 2;
    b->done = 0;
    advance(b); // so that the circuit begins at once, and works while the caller does other things
    return KN_LINK_OK;
}

// Execute the rest of the request, and return its reply if all operations are done.
static kn_link_status look(bar *b, kn_reply *reply)
{
    kn_link_status status = advance(b);
    if (b->ones && b->word[KN_REG_ID] == UINT32_MAX) return KN_LINK_GONE;
    if (status != KN_LINK_OK) return status;
    b->asked = false;
    *reply = b->reply;
    return KN_LINK_OK;
}

// Poll without sleeping for SPIN_NS, then sleep NAP_NS between polls until the deadline.
static kn_link_status wait_reply(void *self, int64_t deadline_ns, kn_reply *reply)
{
    bar *b = self;
    for (int64_t began_ns = kn_now_ns(), now_ns = began_ns;;) {
        kn_link_status status = b->asked ? look(b, reply) : KN_LINK_LATE;
        if (status != KN_LINK_LATE) return status;
        if (now_ns >= deadline_ns) return b->word[KN_REG_ID] == UINT32_MAX ? KN_LINK_GONE : KN_LINK_LATE;
        now_ns = kn_now_ns();
        if (now_ns - began_ns < SPIN_NS) continue;
        kn_clock_sleep(now_ns + NAP_NS < deadline_ns ? now_ns + NAP_NS : deadline_ns);
    }
}

static void forget(void *self) { ((bar *)self)->asked = false; }

static void close_bar(void *self)
{
    bar *b = self;
    if (b->word) {
        unwatch((void *)b->word);
        munmap((void *)b->word, b->bytes);
    }
    for (int i = 0; i < FDS; i++)
        if (b->fd[i] >= 0) close(b->fd[i]);
    free(b);
}

// ---- opening

// Create a link without registers. Return NULL if memory is short.
static bar *create(kn_link *link, char why[KN_LINK_WHY])
{
    bar *b = calloc(1, sizeof *b);
    if (!b) {
        snprintf(why, KN_LINK_WHY, "not enough memory");
        return NULL;
    }
    memset(b->fd, -1, sizeof b->fd);
    *link = (kn_link){.isolated = link->isolated,
                      .self = b,
                      .submit = submit,
                      .wait = wait_reply,
                      .gone = removed,
                      .forget = forget,
                      .close = close_bar};
    return b;
}

// Return whether the link was opened; free it if not.
static bool finish(bar *b, bool opened)
{
    if (b && !opened) close_bar(b);
    return opened;
}

// Map the registers without access first, and allow access afterwards. If the process locks all its memory, mapping
// with access would allocate pages for every word. Touch the pages of a file that a tick needs, so that the tick meets
// no page fault. For a BAR this is not necessary.
static bool map(bar *b, size_t bytes, off_t offset, bool shm)
{
    void *at = mmap(NULL, bytes, PROT_NONE, MAP_SHARED, b->fd[DEVICE], offset);
    if (at == MAP_FAILED) return false;
    if (mprotect(at, bytes, PROT_READ | PROT_WRITE) != 0 || !watch(at, bytes)) {
        munmap(at, bytes);
        return false;
    }
    b->word = at;
    b->bytes = bytes;
    b->words = bytes / 4 > KN_SHM_WORDS ? KN_SHM_WORDS : (uint32_t)(bytes / 4);
    if (!shm) return true;
    b->shm = kn_shm_of(at);
    for (size_t i = 0; i < KN_WINDOW_REACTIONS + 6 * (KN_FIXED_LIST_MAX + 1); i += 512) (void)b->word[i];
    (void)b->word[bytes / 4 - 1];
    return true;
}

// Open and lock the file, check its size and map it.
static bool open_file(bar *b, const char *path, bool shm, char why[KN_LINK_WHY])
{
    struct stat s = {0};
    const int fd = b->fd[DEVICE] = open(path, O_RDWR | O_SYNC | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &s)) snprintf(why, KN_LINK_WHY, "%s: %s", path, strerror(errno));
    else if (flock(fd, LOCK_EX | LOCK_NB)) snprintf(why, KN_LINK_WHY, "%s: in use by another program", path);
    else if (shm ? s.st_size != KN_SHM_BYTES : s.st_size < 4096 || s.st_size % 4)
        snprintf(why, KN_LINK_WHY, "%s: %lld bytes: expected the registers of a circuit", path, (long long)s.st_size);
    else if (map(b, (size_t)s.st_size, 0, shm)) return true;
    else
        snprintf(why, KN_LINK_WHY, "%s: %s", path,
                 shm || errno != EPERM ? strerror(errno)
                                       : "this kernel is locked down: it gives the card to vfio-pci only");
    return false;
}

bool kn_link_shm(kn_link *link, const char *name, char why[KN_LINK_WHY])
{
    char path[KN_LINK_URI + 16];
    snprintf(path, sizeof path, "/dev/shm/%.200s", name);
    bar *b = create(link, why);
    return finish(b, b && open_file(b, path, true, why));
}

// ---- cards

// Get the last part of a link in the folder of a PCI function, "" if there is no such link.
static void read_link(const char *sysfs, const char *function, const char *name, char value[KN_LINK_CARD])
{
    char path[PATH_MAX], target[PATH_MAX];
    snprintf(path, sizeof path, "%s/bus/pci/devices/%s/%s", sysfs, function, name);
    const ssize_t size = readlink(path, target, sizeof target - 1);
    target[size > 0 ? size : 0] = 0;
    snprintf(value, KN_LINK_CARD, "%.63s", basename(target));
}

bool kn_link_vfio(const char *sysfs, const char *function, char driver[KN_LINK_CARD], char group[KN_LINK_CARD])
{
    read_link(sysfs, function, "driver", driver);
    read_link(sysfs, function, "iommu_group", group);
    return *group && strcmp(driver, "vfio-pci") == 0;
}

// Open a card that is bound to vfio-pci, through its IOMMU group. The card reaches no memory of this machine, because
// nothing is mapped for it. One program at a time can have the group.
static bool open_vfio(bar *b, const char *function, const char *group, char why[KN_LINK_WHY])
{
    struct vfio_region_info region = {.argsz = sizeof region, .index = VFIO_PCI_BAR0_REGION_INDEX};
    char step[160] = "/dev/vfio/vfio";
    b->fd[CONTAINER] = open(step, O_RDWR | O_CLOEXEC);
    if (b->fd[CONTAINER] >= 0) {
        snprintf(step, sizeof step, "/dev/vfio/%s", group);
        b->fd[GROUP] = open(step, O_RDWR | O_CLOEXEC);
    }
    if (b->fd[GROUP] >= 0) {
        snprintf(step, sizeof step, "group %s, all of whose cards must be bound to vfio-pci or to no driver", group);
        if (ioctl(b->fd[GROUP], VFIO_GROUP_SET_CONTAINER, &b->fd[CONTAINER]) == 0 &&
            ioctl(b->fd[CONTAINER], VFIO_SET_IOMMU, VFIO_TYPE1v2_IOMMU) == 0)
            b->fd[DEVICE] = ioctl(b->fd[GROUP], VFIO_GROUP_GET_DEVICE_FD, function);
    }
    if (b->fd[DEVICE] >= 0) {
        snprintf(step, sizeof step, "its BAR 0");
        // The kernel signals this eventfd when an operator removes the card, and waits until all descriptors are closed.
        const int removal = b->fd[REMOVAL] = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
        // a struct vfio_irq_set, and the descriptor as its data
        const uint32_t signal[6] = {
            sizeof signal,    VFIO_IRQ_SET_DATA_EVENTFD | VFIO_IRQ_SET_ACTION_TRIGGER, VFIO_PCI_REQ_IRQ_INDEX, 0, 1,
            (uint32_t)removal};
        if (removal >= 0 && ioctl(b->fd[DEVICE], VFIO_DEVICE_SET_IRQS, signal) == 0 &&
            ioctl(b->fd[DEVICE], VFIO_DEVICE_GET_REGION_INFO, &region) == 0 &&
            map(b, region.size, (off_t)region.offset, false))
            return true;
    }
    snprintf(why, KN_LINK_WHY, "pcie:%s by vfio-pci: %s: %s; see knead doctor --card %s", function, step,
             strerror(errno), function);
    return false;
}

bool kn_link_pcie(kn_link *link, const char *function, const char *sysfs, char why[KN_LINK_WHY])
{
    char path[2 * KN_LINK_URI], driver[KN_LINK_CARD], group[KN_LINK_CARD];
    bar *b = create(link, why);
    if (kn_link_vfio(sysfs, function, driver, group)) {
        link->isolated = true;
        return finish(b, b && open_vfio(b, function, group, why));
    }
    if (link->isolated) {
        snprintf(why, KN_LINK_WHY, "pcie:%s: expected to be bound to vfio-pci, as before", function);
        return finish(b, false);
    }
    link->notice = "the card is reached by sysfs: without isolation from the memory of this machine, and not if the "
                   "kernel is locked down; `knead doctor --card` tells how to bind it to vfio-pci";
    snprintf(path, sizeof path, "%.200s/bus/pci/devices/%.16s/resource0", sysfs, function);
    if (!finish(b, b && open_file(b, path, false, why))) return false;
    // The mapping of a card that was removed stays, and another card may get its addresses. From then on a read at the
    // end of the file fails with ENODEV.
    b->fd[REMOVAL] = dup(b->fd[DEVICE]);
    if (b->fd[REMOVAL] >= 0 && lseek(b->fd[REMOVAL], 0, SEEK_END) >= 0) return true;
    snprintf(why, KN_LINK_WHY, "%.300s: %s", path, strerror(errno));
    return finish(b, false);
}
