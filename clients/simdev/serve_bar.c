// Serve the registers in a file of shared memory, which stands for the memory (BAR) of a PCI card. This process does
// not notice a store into shared memory. So a host that has written a word with an effect rings a doorbell, another
// word in the file (server/backend/link.h). Windows are copied between file and engine when the doorbell is handled.
#include "clients/simdev/simdev.h"
#include "core/fixed.h"
#include "hdl/registers.h"
#include "server/backend/link.h"
#include "server/clock.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <unistd.h>

// Polling of the doorbell: without sleep until SPIN_NS after the last request, then with sleeps of NAP_NS until
// AWAKE_NS, then with sleeps of SLEEP_NS.
enum { SPIN_NS = 50000, AWAKE_NS = 1000000000, NAP_NS = 20000, SLEEP_NS = 2000000 };

typedef struct bar {
    kn_simdev *simdev;
    const char *path;
    int fd;
    volatile uint32_t *word;
    kn_shm *shm;
} bar;

// ---- words between the file and the engine

// Copy words from the file into the engine.
static void pull(bar *b, uint32_t from, uint32_t count)
{
    const kn_word_bus *bus = &b->simdev->engine.bus;
    for (uint32_t at = from; at < from + count; at++) bus->write(bus->self, at, b->word[at]);
}

// Copy words from the engine into the file. Skip CONTROL, because it has no meaning when read.
static void push(bar *b, uint32_t from, uint32_t count)
{
    const kn_word_bus *bus = &b->simdev->engine.bus;
    for (uint32_t at = from, word; at < from + count; at++)
        if (at != KN_REG_CONTROL && bus->read(bus->self, at, &word)) b->word[at] = word;
}

// Copy the registers that the engine changes into the file.
static void push_registers(bar *b)
{
    push(b, KN_REG_ID, KN_REG_RESULT_FLAGS + 1);
    if (b->simdev->faults.rate[KN_LINK_FAULT_HASH] > 0) b->word[KN_REG_BUILD_HASH] ^= 1;
}

static uint32_t nodes(const bar *b) { return b->word[KN_REG_NODE_COUNT] & 0x1ffff; }
static uint32_t edges(const bar *b) { return b->word[KN_REG_EDGE_COUNT] & 0xfffff; }
static uint32_t bounds(const bar *b) { return b->word[KN_REG_BOUND_COUNT] & KN_FIXED_LIST_MAX; }

// Copy the whole object: `pull` it into the engine, or `push` it into the file.
static void copy_image(bar *b, void (*copy)(bar *b, uint32_t from, uint32_t count))
{
    copy(b, KN_REG_NODE_COUNT, KN_REG_RELAX - KN_REG_NODE_COUNT + 1);
    copy(b, KN_REG_OMEGA, KN_FIXED_ITERATIONS_MAX);
    copy(b, KN_WINDOW_TABLE, KN_FIXED_SEGMENTS + 1);
    copy(b, KN_WINDOW_NODES, 16 * nodes(b));
    copy(b, KN_WINDOW_REST, 8 * nodes(b));
    copy(b, KN_WINDOW_EDGES, 8 * edges(b));
}

// Copy what a tick changes: x and u of every node, h of every edge.
static void push_state(bar *b)
{
    for (uint32_t n = 0; n < nodes(b); n++) push(b, KN_WINDOW_NODES + 16 * n, 10);
    for (uint32_t e = 0; e < edges(b); e++) push(b, KN_WINDOW_EDGES + 8 * e + 3, 2);
}

// Step one tick that no host has requested. Publish its number before its results. A host that reads first the results
// and then the number notices that the results are not those of the tick it requested.
static void stray(bar *b)
{
    kn_engine *e = &b->simdev->engine;
    e->stray(e->bus.self);
    push(b, KN_REG_TICK, 1);
    __atomic_thread_fence(__ATOMIC_RELEASE);
    push(b, KN_WINDOW_REACTIONS, 3 * bounds(b));
    for (int64_t until_ns = kn_now_ns() + 20000; kn_now_ns() < until_ns;) continue;
    push(b, KN_WINDOW_REACTIONS, 6 * bounds(b));
    push_registers(b);
}

// Execute the write that the doorbell announced: copy the words that this write needs into the engine, write the word,
// and copy the results back into the file.
static void obey(bar *b, uint32_t address, uint32_t word)
{
    const kn_word_bus *bus = &b->simdev->engine.bus;
    b->simdev->requests++;
    pull(b, KN_REG_SCRATCH, 1);
    if (address == KN_REG_CONTROL && word & KN_CONTROL_LOADED) copy_image(b, pull);
    if (address == KN_REG_STEP_SEQ) {
        pull(b, KN_REG_BOUND_COUNT, 1);
        pull(b, KN_WINDOW_BOUNDS, 4 * bounds(b));
    }
    bus->write(bus->self, address, word);
    kn_simdev_run_out(&b->simdev->engine);
    if (address == KN_REG_CONTROL && word & (KN_CONTROL_CRC | KN_CONTROL_REST)) push_state(b);
    if (address == KN_REG_STEP_SEQ) {
        push(b, KN_WINDOW_REACTIONS, 6 * bounds(b));
        for (uint32_t n = 0; n < nodes(b); n++) push(b, KN_WINDOW_NODES + 16 * n + 7, 3); // displacements
    }
    push_registers(b);
}

// ---- the file

// Create the file under another name, lock and fill it, then rename it, so that no host sees a partial file.
static bool make_file(bar *b)
{
    char fresh[PATH_MAX];
    snprintf(fresh, sizeof fresh, "%s.%d", b->path, (int)getpid());
    b->fd = open(fresh, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0660);
    struct flock lock = {.l_type = F_WRLCK};
    if (b->fd < 0 || ftruncate(b->fd, KN_SHM_BYTES) || fcntl(b->fd, F_OFD_SETLK, &lock)) return false;
    void *at = mmap(NULL, KN_SHM_BYTES, PROT_READ | PROT_WRITE, MAP_SHARED, b->fd, 0);
    if (at == MAP_FAILED) return false;
    b->word = at;
    b->shm = kn_shm_of(at);
    push_registers(b);
    // The engine may hold an object, because its memory survives the fault `disconnect`.
    copy_image(b, push);
    push(b, KN_REG_BOUND_COUNT, 1);
    push(b, KN_WINDOW_BOUNDS, 4 * bounds(b));
    push(b, KN_WINDOW_REACTIONS, 6 * bounds(b));
    return rename(fresh, b->path) == 0;
}

static void drop_file(bar *b)
{
    b->word[KN_REG_ID] = UINT32_MAX; // a host reads all ones from a PCI card that was removed
    munmap((void *)b->word, KN_SHM_BYTES);
    close(b->fd);
    unlink(b->path);
}

// In a file that an earlier simulator left behind, mark the device as removed, so that hosts notice. Return false if
// another simulator still serves the file.
static bool retire(const char *path)
{
    int fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0) return errno == ENOENT;
    struct flock lock = {.l_type = F_WRLCK};
    struct stat s;
    bool ours = fcntl(fd, F_OFD_SETLK, &lock) == 0;
    if (!ours) errno = EBUSY;
    if (ours && fstat(fd, &s) == 0 && s.st_size == KN_SHM_BYTES) {
        const uint32_t ones = UINT32_MAX;
        ours = pwrite(fd, &ones, sizeof ones, 4 * KN_REG_ID) == sizeof ones;
    }
    close(fd);
    return ours;
}

// Handle the doorbell if a host has rung it, otherwise sleep. If a fault unplugs the device, the request is lost.
// Return false if the file could not be created again.
static bool listen_once(bar *b, int64_t *heard_ns)
{
    kn_engine *e = &b->simdev->engine;
    uint32_t done = b->shm->done, bell = __atomic_load_n(&b->shm->bell, __ATOMIC_ACQUIRE);
    if (bell == done) {
        int64_t quiet_ns = kn_now_ns() - *heard_ns;
        if (quiet_ns > SPIN_NS) kn_clock_sleep(kn_now_ns() + (quiet_ns < AWAKE_NS ? NAP_NS : SLEEP_NS));
        return true;
    }
    bool blanked;
    const bool unplugged = kn_simdev_suffer(b->simdev, &blanked);
    if (blanked) b->word[KN_REG_SCRATCH] = b->word[KN_REG_NODE_COUNT] = b->word[KN_REG_EDGE_COUNT] = 0;
    if (unplugged) {
        drop_file(b);
        kn_clock_sleep(kn_now_ns() + KN_SIMDEV_UNPLUGGED_NS);
        *heard_ns = kn_now_ns();
        return make_file(b);
    }
    uint32_t address = b->shm->bell_address;
    obey(b, address, b->shm->bell_word);
    __atomic_store_n(&b->shm->done, done + 1, __ATOMIC_RELEASE);
    if (address == KN_REG_STEP_SEQ && e->stray && kn_link_faults_strike(&b->simdev->faults, KN_LINK_FAULT_TORN))
        stray(b);
    *heard_ns = kn_now_ns();
    return true;
}

bool kn_simdev_bar(kn_simdev *simdev, const char *name)
{
    char path[PATH_MAX];
    snprintf(path, sizeof path, "/dev/shm/%s", name);
    bar b = {.simdev = simdev, .path = path};
    prctl(PR_SET_TIMERSLACK, 1000UL);
    if (!retire(path) || !make_file(&b)) return false;
    printf("shm:%s\n", name);
    fflush(stdout);
    bool good = true;
    for (int64_t heard_ns = 0; good && !*simdev->stop;) good = listen_once(&b, &heard_ns);
    if (good) drop_file(&b);
    return good;
}
