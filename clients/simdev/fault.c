#include "clients/simdev/fault.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Words of the faults, and whether they only apply to frames.
static const struct {
    const char *word;
    bool frames;
} faults_known[KN_FAULT_COUNT] = {
#define KN_FAULT_ROW(name, word, frames, what) [KN_FAULT_##name] = {#word, frames},
    KN_FAULTS(KN_FAULT_ROW)
#undef KN_FAULT_ROW
};

const char *kn_fault_word(kn_fault fault) { return faults_known[fault].word; }

bool kn_fault_of_frames(kn_fault fault) { return faults_known[fault].frames; }

// Set the rate of one entry, NAME or NAME=RATE.
static bool parse_one(kn_faults *f, const char *entry, size_t length)
{
    const char *equals = memchr(entry, '=', length);
    size_t name = equals ? (size_t)(equals - entry) : length;
    char *end = NULL;
    double rate = equals ? strtod(equals + 1, &end) : 0.01;
    if (equals && (end != entry + length || end == equals + 1 || !(rate >= 0 && rate <= 1))) return false;
    for (int i = 0; i < KN_FAULT_COUNT; i++) {
        if (strlen(faults_known[i].word) != name || strncmp(faults_known[i].word, entry, name) != 0) continue;
        f->rate[i] = rate;
        return true;
    }
    return false;
}

bool kn_faults_parse(kn_faults *faults, const char *text, char bad[64])
{
    for (const char *at = text;; at++) {
        size_t length = strcspn(at, ",");
        if (!parse_one(faults, at, length)) {
            snprintf(bad, 64, "%.*s", length < 60 ? (int)length : 60, at);
            return false;
        }
        at += length;
        if (!*at) return true;
    }
}

uint32_t kn_faults_random(kn_faults *faults, uint32_t below) // xorshift64*
{
    faults->seed ^= faults->seed >> 12, faults->seed ^= faults->seed << 25, faults->seed ^= faults->seed >> 27;
    return (uint32_t)((faults->seed * 0x2545f4914f6cdd1du >> 32) * below >> 32);
}

// Compare a random number of 30 bits with the rate.
bool kn_faults_strike(kn_faults *faults, kn_fault fault)
{
    if (faults->rate[fault] <= 0) return false;
    bool strikes = kn_faults_random(faults, 1u << 30) < faults->rate[fault] * (1u << 30);
    faults->done[fault] += strikes;
    return strikes;
}

size_t kn_faults_mangle(kn_faults *faults, uint8_t *wire, size_t size)
{
    if (kn_faults_strike(faults, KN_FAULT_FLIP))
        wire[kn_faults_random(faults, (uint32_t)size - 1)] ^= (uint8_t)(1u << kn_faults_random(faults, 8));
    if (!kn_faults_strike(faults, KN_FAULT_TRUNCATE)) return size;
    size = 1 + kn_faults_random(faults, (uint32_t)size - 1);
    wire[size - 1] = 0;
    return size;
}
