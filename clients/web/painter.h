#ifndef KN_CLIENTS_PAINTER_H
#define KN_CLIENTS_PAINTER_H
// A thread that draws: one still in, one JPEG out, while the caller goes on with its messages. It opens, draws and
// closes OpenGL by itself, since a context belongs to one thread, and runs at nice 5: pictures may be late, forces
// not.
//
//     fill painter->still -> kn_painter_draw ... done(arg), in the painter's thread -> kn_painter_drawn: jpeg, size
#include "clients/knead/still.h"
#include "clients/viewer/label.h"
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

typedef struct kn_painter {
    kn_still still;      // the caller's between drawings; a new vertex_count or mesh_id needs fresh = true
    bool fresh;          // still's topology or rest shape is another one
    uint8_t *jpeg;       // of the last drawing; the caller's between drawings
    unsigned long size;  // 0: it could not be drawn
    const char *png;     // the caller's: where the next one is written, too, without loss and with its words; NULL: not
    kn_label label;      // those words; the bar's are the painter's
    double bar_m;        // length of the bar on the table, of the last drawing
    char png_error[256]; // "", or why it was not written
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

// painter: zeroed but for still.view, and stays where it is. False and one line in error: no OpenGL.
bool kn_painter_open(kn_painter *painter, int width, int height, void (*done)(void *arg), void *arg, char *error,
                     size_t error_size);
size_t kn_painter_largest(int width, int height); // bytes that a JPEG of this size may have
void kn_painter_draw(kn_painter *painter);        // from here on still and jpeg are the painter's
// Whether they are the caller's again. However it has heard of done: what hands them over is this.
bool kn_painter_drawn(const kn_painter *painter);
void kn_painter_close(kn_painter *painter);

#endif
