#ifndef KN_CLIENTS_VIDEO_FILE_H
#define KN_CLIENTS_VIDEO_FILE_H
// A film made from pictures. The pictures go through a pipe to the program ffmpeg, at the speed at which ffmpeg encodes
// them. ffmpeg is run without a shell and never linked. The film is written to a temporary file in the same folder and
// renamed when it is complete.
//
//     kn_video_file_open -> kn_video_file_add, picture by picture -> kn_video_file_keep, or kn_video_file_drop
//
// Only one film can be open at a time. SIGPIPE is ignored while a film is open, so that the death of ffmpeg is reported
// and does not end this process.
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define KN_VIDEO_FILE_NAMES ".mp4, .mov or .mkv (H.264), .webm (VP9) or .gif"

typedef struct kn_video_file kn_video_file;

// Return true if the ending of the name is one of KN_VIDEO_FILE_NAMES.
bool kn_video_file_knows(const char *path);
// Return true if ffmpeg is installed. Otherwise return false with one sentence in error.
bool kn_video_file_ready(char *error, size_t error_size);

// Start a film. A nonzero `*stopped` ends every wait for ffmpeg. `width` and `height` must be even, `fps` > 0. Return
// NULL with one sentence in error if ffmpeg is missing or path cannot be written.
kn_video_file *kn_video_file_open(const char *path, int width, int height, double fps,
                                  const volatile sig_atomic_t *stopped, char *error, size_t error_size);

// Add a picture, rgba [height][width][4], top row first. Return false if ffmpeg has ended or `*stopped` is set. After
// false, call kn_video_file_keep or kn_video_file_drop.
bool kn_video_file_add(kn_video_file *film, const uint8_t *rgba);

// End the film and keep the file. On failure return false with one sentence in error, which includes ffmpeg's last
// line, and leave no file.
bool kn_video_file_keep(kn_video_file *film, char *error, size_t error_size);
// End the film without a file. NULL is allowed.
void kn_video_file_drop(kn_video_file *film);

#endif
