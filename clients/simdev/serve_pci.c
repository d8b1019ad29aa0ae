// Serve the registers as BAR 0 of a PCI function in a guest of QEMU, whose kernel sees a card.
//
//     guest's kernel --configuration, BAR--> QEMU (-device x-pci-proxy-dev,fd=3) --socket--> this process --> engine
//
// QEMU sends every access to the function as a message and waits for the answer. An access to the BAR is a transfer of
// the engine's word bus. The messages are those of QEMU 7.2 (hw/remote), which documents no format for them.
#include "clients/simdev/simdev.h"
#include "hdl/registers.h"
#include <errno.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

enum { BAR_BYTES = 1 << 26, BAR_0 = 0x10 };

// Commands of messages. SYNC_SYSMEM and SET_IRQFD bring file descriptors, which read() drops, and get no answer.
enum { SYNC_SYSMEM, RETURN, CONFIG_WRITE, CONFIG_READ, BAR_WRITE, BAR_READ, SET_IRQFD, RESET };

typedef struct message {
    int32_t command, padding;
    uint64_t size; // of data, bytes
    union {
        uint64_t answer;
        struct {
            uint32_t address, value, bytes;
        } config;
        struct {
            uint64_t address, value;
            uint32_t bytes;
        } bar; // address: of the guest's memory
        uint8_t sysmem[192];
    } data;
} message;
#define HEADER_BYTES offsetof(message, data)

// Words of the configuration space, and the bits of each that the guest may write: a processing accelerator with one
// memory BAR and no interrupt. QEMU uses the vendor number 0x1234 for devices without a vendor.
typedef struct function {
    uint32_t word[64], writable[64];
} function;
static const function power_up = {.word = {0x4b4e1234, 0, 0x12000001, [11] = 0x00011234},
                                  .writable = {[1] = 0x406, [3] = 0xffff, [BAR_0 / 4] = 0u - BAR_BYTES, [15] = 0xff}};

static uint64_t access_config(function *f, const message *m)
{
    const uint32_t at = m->data.config.address, bytes = m->data.config.bytes;
    if (at > sizeof f->word - 4 || at % 4 + bytes > 4) return UINT32_MAX;
    const uint32_t shift = 8 * (at % 4), bits = bytes < 4 ? (1u << 8 * bytes) - 1 : UINT32_MAX;
    uint32_t *word = &f->word[at / 4], may = f->writable[at / 4] & bits << shift;
    if (m->command == CONFIG_WRITE) *word = (*word & ~may) | (m->data.config.value << shift & may);
    return *word >> shift & bits;
}

// Transfer a word. What a word bus has no transfer for reads as all ones, and its write is lost.
static uint64_t access_bar(const function *f, kn_simdev *s, const message *m)
{
    const uint64_t offset = m->data.bar.address - f->word[BAR_0 / 4];
    const kn_word_bus *bus = &s->engine.bus;
    uint32_t word = UINT32_MAX;
    s->requests++;
    if (m->data.bar.bytes != 4 || offset % 4 || offset >= BAR_BYTES) return word;
    const uint32_t address = (uint32_t)offset / 4;
    if (m->command == BAR_READ) return bus->read(bus->self, address, &word) ? word : UINT32_MAX;
    bus->write(bus->self, address, (uint32_t)m->data.bar.value);
    if (address == KN_REG_CONTROL || address == KN_REG_STEP_SEQ) kn_simdev_run_out(&s->engine);
    return 0;
}

// Answer a message. Return false if it is none of those above.
static bool obey(function *f, kn_simdev *s, const message *m, int fd)
{
    message answer = {.command = RETURN, .size = sizeof answer.data.answer};
    if (m->size > sizeof m->data) return false;
    // The circuit neither reads the guest's memory nor interrupts, and a reset keeps its memory.
    if (m->command == SYNC_SYSMEM || m->command == SET_IRQFD) return true;
    if (m->command < CONFIG_WRITE || m->command > RESET) return false;
    if (m->command <= CONFIG_READ) answer.data.answer = access_config(f, m);
    else if (m->command <= BAR_READ) answer.data.answer = access_bar(f, s, m);
    send(fd, &answer, HEADER_BYTES + sizeof answer.data.answer, MSG_NOSIGNAL);
    return true;
}

// Start QEMU with one end of a socket as its file descriptor 3. Return the other end, or NULL with errno set.
static FILE *start(pid_t *child, char **qemu)
{
    posix_spawn_file_actions_t as_third;
    int pair[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair)) return NULL;
    posix_spawn_file_actions_init(&as_third);
    posix_spawn_file_actions_adddup2(&as_third, pair[1], 3);
    const int refused = posix_spawnp(child, qemu[0], &as_third, NULL, qemu, environ);
    posix_spawn_file_actions_destroy(&as_third);
    close(pair[1]);
    errno = refused;
    return refused ? NULL : fdopen(pair[0], "r");
}

bool kn_simdev_pci(kn_simdev *simdev, char **qemu)
{
    function f = power_up;
    message m;
    pid_t child;
    int status;
    FILE *from = start(&child, qemu);
    if (!from) return false;
    bool known = true;
    while (known && !*simdev->stop && fread(&m, HEADER_BYTES, 1, from) &&
           (m.size > sizeof m.data || fread(&m.data, 1, m.size, from) == m.size))
        known = obey(&f, simdev, &m, fileno(from));
    if (!known || *simdev->stop) kill(child, SIGTERM);
    waitpid(child, &status, 0);
    fclose(from);
    if (!known) fprintf(stderr, "knead-simdev: %s: message %d: expected those of QEMU 7.2\n", qemu[0], m.command);
    else if (!*simdev->stop && status)
        fprintf(stderr, "knead-simdev: %s ended with %s %d\n", qemu[0], WIFSIGNALED(status) ? "signal" : "exit code",
                WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
    errno = 0;
    return known && (*simdev->stop || !status);
}
