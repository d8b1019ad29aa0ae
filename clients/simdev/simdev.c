// Functions for both kinds of link, serial line and shared memory: faults at random, and faults that strike a whole
// request.
#include "clients/simdev/simdev.h"
#include "hdl/registers.h"
#include "server/clock.h"
#include "server/option_table.h"
#include <stdio.h>
#include <string.h>

const kn_link_fault_kind kn_link_fault_kinds[KN_LINK_FAULT_COUNT] = {
#define KN_LINK_FAULT_ROW(name, word, frames, what) [KN_LINK_FAULT_##name] = {#word, what, frames},
    KN_LINK_FAULTS(KN_LINK_FAULT_ROW)
#undef KN_LINK_FAULT_ROW
};

// Parse one entry, NAME or NAME=RATE, and set the rate of this fault.
static bool parse_one(kn_link_faults *f, const char *entry)
{
    const size_t name = strcspn(entry, "=");
    double rate = 0.01;
    if (entry[name] && !kn_number_take(entry + name + 1, 0, 1, &rate)) return false;
    for (int i = 0; i < KN_LINK_FAULT_COUNT; i++) {
        const char *word = kn_link_fault_kinds[i].word;
        if (strlen(word) != name || strncmp(word, entry, name) != 0) continue;
        f->rate[i] = rate;
        return true;
    }
    return false;
}

bool kn_link_faults_parse(kn_link_faults *faults, const char *text, char bad[64])
{
    for (const char *at = text;; at++) {
        const size_t length = strcspn(at, ",");
        snprintf(bad, 64, "%.*s", length < 60 ? (int)length : 60, at);
        if (!parse_one(faults, bad)) return false;
        at += length;
        if (!*at) return true;
    }
}

static uint32_t random_below(kn_link_faults *faults, uint32_t below) // xorshift64*
{
    faults->seed ^= faults->seed >> 12, faults->seed ^= faults->seed << 25, faults->seed ^= faults->seed >> 27;
    return (uint32_t)((faults->seed * 0x2545f4914f6cdd1du >> 32) * below >> 32);
}

// Compare a random number of 30 bits with the rate.
bool kn_link_faults_strike(kn_link_faults *faults, kn_link_fault fault)
{
    if (faults->rate[fault] <= 0) return false;
    bool strikes = random_below(faults, 1u << 30) < faults->rate[fault] * (1u << 30);
    faults->done[fault] += strikes;
    return strikes;
}

size_t kn_link_faults_mangle(kn_link_faults *faults, uint8_t *wire, size_t size)
{
    if (kn_link_faults_strike(faults, KN_LINK_FAULT_FLIP))
        wire[random_below(faults, (uint32_t)size - 1)] ^= (uint8_t)(1u << random_below(faults, 8));
    if (!kn_link_faults_strike(faults, KN_LINK_FAULT_TRUNCATE)) return size;
    size = 1 + random_below(faults, (uint32_t)size - 1);
    wire[size - 1] = 0;
    return size;
}

void kn_simdev_run_out(const kn_engine *e)
{
    for (uint32_t status; e->bus.read(e->bus.self, KN_REG_STATUS, &status) && status & KN_STATUS_BUSY;) continue;
}

bool kn_simdev_suffer(kn_simdev *s, bool *blanked)
{
    if (kn_link_faults_strike(&s->faults, KN_LINK_FAULT_DELAY))
        kn_clock_sleep(kn_now_ns() + 1000000 + random_below(&s->faults, 3000000));
    if (kn_link_faults_strike(&s->faults, KN_LINK_FAULT_HANG)) kn_clock_sleep(kn_now_ns() + 20000000);
    *blanked = kn_link_faults_strike(&s->faults, KN_LINK_FAULT_BLANK);
    if (*blanked) s->engine.blank(s->engine.bus.self);
    return kn_link_faults_strike(&s->faults, KN_LINK_FAULT_DISCONNECT);
}
