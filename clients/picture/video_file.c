#include "clients/picture/video_file.h"
#include "clients/viewer/beside.h"
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

// ARGS_MAX: largest number of arguments of ffmpeg. NICENESS: niceness of ffmpeg, so that a servo loop on this machine
// has priority. EXIT_NO_PROGRAM: exit code of the child process if ffmpeg is not installed.
enum { ARGS_MAX = 48, NICENESS = 10, EXIT_NO_PROGRAM = 127 };

struct kn_video_file {
    kn_beside out;
    // Unnamed file that receives the text output of ffmpeg. A pipe would fill up and block ffmpeg, because its output
    // is read only at the end.
    FILE *said;
    pid_t ffmpeg; // process id of ffmpeg; 0: ffmpeg has ended
    int pipe, status;
    bool broken; // true: a picture could not be written to ffmpeg
    size_t picture_bytes;
    const volatile sig_atomic_t *stopped;
    struct sigaction before; // signal action of SIGPIPE before the film was opened
};

// Encoder arguments of ffmpeg for each ending of the file name. H.264 with crf 18 has no visible loss. VP9 has the same
// quality with these options, and its encoder is fast enough to follow the pictures. A GIF gets a palette for each
// picture: to compute one palette for the whole film, ffmpeg would keep all pictures in memory.
typedef struct format {
    const char *ending, *args[16];
} format;

static const format formats[] = {
    {".mp4", {"-c:v", "libx264", "-crf", "18", "-movflags", "+faststart", "-f", "mp4"}},
    {".mov", {"-c:v", "libx264", "-crf", "18", "-movflags", "+faststart", "-f", "mov"}},
    {".mkv", {"-c:v", "libx264", "-crf", "18", "-f", "matroska"}},
    {".webm", {"-c:v", "libvpx-vp9", "-crf", "24", "-b:v", "0", "-cpu-used", "4", "-row-mt", "1", "-f", "webm"}},
    {".gif", {"-filter_complex", "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1", "-f", "gif"}},
};

// Arguments of ffmpeg that convert the sRGB colours of the renderer to the colour space and the pixel format that
// players expect of a film (bt709, yuv420p).
static const char *const yuv[] = {"-vf",
                                  "scale=out_color_matrix=bt709:out_range=tv",
                                  "-pix_fmt",
                                  "yuv420p",
                                  "-colorspace",
                                  "bt709",
                                  "-color_primaries",
                                  "bt709",
                                  "-color_trc",
                                  "bt709",
                                  "-color_range",
                                  "tv",
                                  NULL};

static const format *format_of(const char *path)
{
    const size_t length = strlen(path);
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        const size_t n = strlen(formats[i].ending);
        if (length > n && strcmp(path + length - n, formats[i].ending) == 0) return &formats[i];
    }
    return NULL;
}

bool kn_video_file_knows(const char *path) { return format_of(path) != NULL; }

static int add_all(const char **argv, int count, const char *const *more)
{
    while (*more) argv[count++] = *more++;
    return count;
}

// Replace this child process by ffmpeg. Ctrl-C in the terminal must not end ffmpeg: the parent process ends it and
// removes the file of an interrupted film.
static void become(const kn_video_file *film, int from, const format *f, int width, int height, double fps)
{
    const char *argv[ARGS_MAX] = {NULL};
    char size[32], rate[32];
    snprintf(size, sizeof size, "%dx%d", width, height);
    snprintf(rate, sizeof rate, "%.6g", fps);
    const char *const head[] = {"ffmpeg",   "-hide_banner",  "-nostats", "-loglevel",   "error", "-y",         "-f",
                                "rawvideo", "-pixel_format", "rgba",     "-video_size", size,    "-framerate", rate,
                                "-i",       "pipe:0",        NULL};
    int n = add_all(argv, 0, head);
    // Convert the colours for all formats except GIF, because a GIF stores RGB.
    if (strcmp(f->ending, ".gif") != 0) n = add_all(argv, n, yuv);
    n = add_all(argv, n, f->args);
    char name[sizeof film->out.tmp + 8];
    // Without the prefix, ffmpeg would take the part of a name before a colon for a protocol.
    snprintf(name, sizeof name, "file:%s", film->out.tmp);
    argv[n] = name;
    // Put ffmpeg into its own process group, which signals of the terminal do not reach.
    setpgid(0, 0);
    signal(SIGPIPE, SIG_DFL);
    dup2(from, STDIN_FILENO);
    dup2(fileno(film->said), STDOUT_FILENO);
    dup2(fileno(film->said), STDERR_FILENO);
    if (nice(NICENESS) < 0) errno = 0; // if nice fails, ffmpeg runs at the usual priority
    execvp(argv[0], (char *const *)argv);
    _exit(errno == ENOENT ? EXIT_NO_PROGRAM : 1);
}

// Search PATH for ffmpeg, as execvp will do.
bool kn_video_file_ready(char *error, size_t error_size)
{
    static const char program[] = "ffmpeg";
    const char *path = getenv("PATH");
    char name[4096];
    for (const char *p = path ? path : "/usr/bin:/bin"; *p;) {
        const size_t n = strcspn(p, ":");
        struct stat there;
        if (snprintf(name, sizeof name, "%.*s/%s", (int)n, p, program) < (int)sizeof name && stat(name, &there) == 0 &&
            S_ISREG(there.st_mode) && access(name, X_OK) == 0)
            return true;
        p += n + (p[n] == ':');
    }
    snprintf(error, error_size, "films need ffmpeg, which is not installed: install the package ffmpeg");
    return false;
}

// Start ffmpeg with a pipe to its standard input.
static bool start(kn_video_file *film, const format *f, int width, int height, double fps)
{
    int ends[2];
    film->said = tmpfile();
    if (!film->said || pipe2(ends, O_CLOEXEC) != 0) return false;
    film->pipe = ends[1];
    film->ffmpeg = fork();
    if (film->ffmpeg == 0) become(film, ends[0], f, width, height, fps);
    if (film->ffmpeg < 0) film->ffmpeg = 0, film->status = -1;
    const bool started = film->ffmpeg > 0;
    // Both the parent and the child put ffmpeg into its process group, because either may run first.
    if (started) setpgid(film->ffmpeg, film->ffmpeg);
    close(ends[0]);
    return started;
}

kn_video_file *kn_video_file_open(const char *path, int width, int height, double fps,
                                  const volatile sig_atomic_t *stopped, char *error, size_t error_size)
{
    const format *f = format_of(path);
    if (!f) return snprintf(error, error_size, "%s: expected a name that ends in %s", path, KN_VIDEO_FILE_NAMES), NULL;
    if (!kn_video_file_ready(error, error_size)) return NULL;
    kn_video_file *film = calloc(1, sizeof *film);
    if (!film) return snprintf(error, error_size, "out of memory"), NULL;
    film->stopped = stopped;
    film->pipe = -1;
    film->picture_bytes = 4 * (size_t)width * (size_t)height;
    if (!kn_beside_open(&film->out, path, error, error_size)) return free(film), NULL;
    // Ignore SIGPIPE, so that a write to an ffmpeg that has died returns an error.
    sigaction(SIGPIPE, &(struct sigaction){.sa_handler = SIG_IGN}, &film->before);
    if (start(film, f, width, height, fps)) return film;
    snprintf(error, error_size, "ffmpeg: %s", strerror(errno));
    kn_video_file_drop(film);
    return NULL;
}

bool kn_video_file_add(kn_video_file *film, const uint8_t *rgba)
{
    // A signal may interrupt a write. After an interrupted write, continue only if `*stopped` is 0.
    for (size_t done = 0; done < film->picture_bytes;) {
        if (*film->stopped) return false;
        const ssize_t n = write(film->pipe, rgba + done, film->picture_bytes - done);
        if (n < 0 && errno != EINTR) return film->broken = true, false;
        if (n > 0) done += (size_t)n;
    }
    return true;
}

// Wait until ffmpeg has ended. ffmpeg ends by itself when the pipe is closed. If `at_once` is true, kill ffmpeg
// instead.
static void end(kn_video_file *film, bool at_once)
{
    if (film->pipe >= 0) close(film->pipe);
    film->pipe = -1;
    while (film->ffmpeg > 0) {
        // Kill the whole group: ffmpeg may be a wrapper that has started other processes.
        if (at_once || *film->stopped) kill(-film->ffmpeg, SIGKILL);
        const pid_t ended = waitpid(film->ffmpeg, &film->status, 0);
        if (ended > 0 || errno != EINTR) film->ffmpeg = 0;
    }
    sigaction(SIGPIPE, &film->before, NULL);
}

// Find the last line of ffmpeg's output and replace characters that are not printable.
static void last_line(FILE *said, char *line, size_t size)
{
    char next[300];
    snprintf(line, size, "it printed no message");
    rewind(said);
    while (fgets(next, sizeof next, said)) {
        next[strcspn(next, "\r\n")] = '\0';
        if (*next) snprintf(line, size, "%s", next);
    }
    for (char *c = line; *c; c++)
        if ((unsigned char)*c < ' ' || *c == 0x7f) *c = '?';
}

static void destroy(kn_video_file *film)
{
    if (film->said) fclose(film->said);
    free(film);
}

bool kn_video_file_keep(kn_video_file *film, char *error, size_t error_size)
{
    char line[300];
    end(film, false);
    struct stat made;
    const bool ended_well = WIFEXITED(film->status) && WEXITSTATUS(film->status) == 0 && !*film->stopped;
    // Check that the file exists and is not empty, because ffmpeg may report success but write no file if it has
    // received no picture.
    const bool whole = ended_well && !film->broken && stat(film->out.tmp, &made) == 0 && made.st_size > 0;
    last_line(film->said, line, sizeof line);
    bool kept = whole && kn_beside_keep(&film->out, error, error_size);
    if (!whole) {
        snprintf(error, error_size, "ffmpeg could not make the film: %s", line);
        kn_beside_drop(&film->out);
    }
    destroy(film);
    return kept;
}

void kn_video_file_drop(kn_video_file *film)
{
    if (!film) return;
    end(film, true);
    kn_beside_drop(&film->out);
    destroy(film);
}
