#ifndef KN_CLIENTS_PAINTER_H
#define KN_CLIENTS_PAINTER_H
// Painter: a thread that draws one still (still.h) at a time as a JPEG, while the caller handles messages. The thread
// opens, uses and closes OpenGL itself, because an OpenGL context belongs to one thread. The thread runs at nice 5,
// because pictures may be late and forces may not.
//
//     fill painter->still -> kn_painter_draw ... done(arg), in the painter's thread -> kn_painter_drawn: jpeg, size
#include "clients/knead/still.h"
#include "clients/viewer/label.h"
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

typedef struct kn_painter {
    kn_still still;     // still to draw; the caller may change it between drawings
    bool fresh;         // set by the caller if `still` has a new topology or rest shape (vertex_count, mesh_id)
    uint8_t *jpeg;      // the last picture as a JPEG; the caller may use `jpeg` between drawings
    unsigned long size; // size of `jpeg`, bytes; 0: the drawing failed
    // Set by the caller: path for a PNG copy of the next picture, with the texts in `label`; NULL: make no copy.
    const char *png;
    kn_label label;      // texts to write on the PNG copy; the painter adds the text of the scale bar
    double bar_m;        // length of the scale bar on the table in the last drawing
    char png_error[256]; // reason why the PNG copy was not written, or ""
    // private
    int width, height;
    void (*done)(void *arg);
    void *arg;
    atomic_bool stop, drawn;
    sem_t wake, opened;
    char *error;
    size_t error_size;
    pthread_t thread;
} kn_painter;

// Start the thread. The painter must be zeroed except for still.view, and must not move in memory afterwards. done:
// called in the painter's thread after each drawing. If OpenGL is not available, return false and one line in `error`.
bool kn_painter_open(kn_painter *painter, int width, int height, void (*done)(void *arg), void *arg, char *error,
                     size_t error_size);
size_t kn_painter_largest(int width, int height); // returns the largest size of a JPEG of width x height pixels, bytes
// Starts a drawing; `still` and `jpeg` belong to the painter until it is complete.
void kn_painter_draw(kn_painter *painter);
// Return true if the drawing is complete. From then on `still` and `jpeg` belong to the caller again. The caller must
// make this call even after `done`, because only this call orders the memory accesses of the two threads.
bool kn_painter_drawn(const kn_painter *painter);
void kn_painter_close(kn_painter *painter);

#endif
