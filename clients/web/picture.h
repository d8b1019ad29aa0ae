#ifndef KN_CLIENTS_PICTURE_H
#define KN_CLIENTS_PICTURE_H
// Pictures for the pages of `knead web`: the view, the colours and the time of each picture, and a thread that draws
// one still (object_still.h) at a time as a JPEG, while the main thread handles messages. The drawing thread opens,
// uses and closes OpenGL itself, because an OpenGL context belongs to one thread. The drawing thread runs at nice 5,
// because pictures may be late and forces may not. A page gets pictures if its browser cannot draw (no WebGL). All such
// pages share one view.
//
//     new mesh -> kn_picture_paint -> (drawing thread) -> jpeg, jpeg_size, count
#include "clients/picture/object_still.h"
#include "clients/web/page_tool.h"
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

typedef struct kn_picture {
    // Set by the caller.
    struct ev_loop *ev;
    kn_gateway *gateway;
    kn_live_server *live;
    kn_page_tool *tool;
    // State, read by other modules.
    uint8_t *jpeg; // newest finished picture; the thread works on the next one
    size_t jpeg_size;
    uint32_t count;     // number of finished pictures
    int32_t shown;      // number of the newest pointer event in the last finished picture
    kn_view_scene look; // view of the next picture
    int measure;        // measure that colours the object, -1: none
    double top;         // value at the top of the colour scale, in the unit of the measure
    int64_t mesh_id;    // id of the mesh in `still`; the caller sets 0 when the scene has changed
    // Fields shared with the drawing thread, which owns them from the start of a drawing until `drawn` is true.
    kn_object_still still;
    bool fresh;               // true: `still` has a new topology or rest shape (vertex_count, mesh_id)
    uint8_t *drawn_jpeg;      // the drawn picture
    unsigned long drawn_size; // size of drawn_jpeg, bytes; 0: the drawing failed
    // The fields below are used by picture.c only.
    ev_async painted;
    atomic_bool stop, drawn, failed; // failed: there is no OpenGL, for the reason in `error`
    sem_t wake;
    char error[300];
    pthread_t thread;
    bool runs;        // true: the thread has been started and must be joined
    bool drawing;     // true: the thread draws, or its picture has not been fetched yet
    int32_t painting; // number of the newest pointer event in the picture being drawn
    double due_ms;    // time when the next drawing should begin
} kn_picture;

size_t kn_picture_largest(void); // returns the largest size of a picture, bytes
// Prepare the pictures. The picture must be zeroed except for the fields of the caller, and must not move in memory
// afterwards. OpenGL is opened when the first page wants pictures. Return false if memory is short.
bool kn_picture_open(kn_picture *picture);
// Return the reason in one line why there are no pictures, or NULL.
const char *kn_picture_trouble(const kn_picture *picture);
// Return true if the mesh messages contain this measure.
bool kn_picture_measured(const kn_live_server *live, int measure);
void kn_picture_paint(kn_picture *picture); // draws the next picture if one is due
// Handle a request of a page: DRAW, VIEW or MEASURE. A measure is the page's own if the page draws the object.
void kn_picture_request(kn_picture *picture, int page, const kn_page_request *request);
void kn_picture_close(kn_picture *picture);

#endif
