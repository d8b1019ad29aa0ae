#ifndef KN_CLIENTS_FILM_H
#define KN_CLIENTS_FILM_H
// Pictures as a film: handed to the program ffmpeg through a pipe, at the rate that it encodes them. ffmpeg is run,
// without a shell, never linked. The file is written beside its path and renamed when it is whole.
//
//     kn_film_open -> kn_film_add, picture by picture -> kn_film_keep, or kn_film_drop
//
// One film at a time: while one is open SIGPIPE is ignored, so that an ffmpeg that dies is told and not died of.
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_FILM_NAMES ".mp4, .mov or .mkv: H.264, .webm: VP9, .gif"

typedef struct kn_film kn_film;

bool kn_film_knows(const char *path);               // by its ending
bool kn_film_ready(char *error, size_t error_size); // ffmpeg is there, else one sentence

// stopped: nonzero gives up what waits for ffmpeg. NULL and one sentence in error: ffmpeg is not there, or path cannot
// be written. width and height even, fps > 0.
kn_film *kn_film_open(const char *path, int width, int height, double fps, const volatile sig_atomic_t *stopped,
                      char *error, size_t error_size);

// rgba [height][width][4], top row first. False: ffmpeg has ended, or stopped; kn_film_keep or _drop must follow.
bool kn_film_add(kn_film *film, const uint8_t *rgba);

// Either ends it. keep: false and one sentence in error, ffmpeg's last line among it; then there is no file.
bool kn_film_keep(kn_film *film, char *error, size_t error_size);
void kn_film_drop(kn_film *film); // NULL is fine

#endif
