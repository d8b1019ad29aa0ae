#include "core/ensemble.h"

#include <pthread.h>
#include <stdlib.h>

typedef struct worker { // a thread and its scratch; worker 0 is the thread that calls kn_ensemble_step
    kn_ensemble *ensemble;
    kn_scratch *scratch;
    pthread_t thread;
} worker;

struct kn_ensemble {
    const kn_model *model;
    int count, threads;
    kn_state **state; // [count]
    worker *worker;   // [threads]
    pthread_mutex_t lock;
    pthread_cond_t begin, end;
    // the work of the present call, under `lock`
    int started;   // number of running threads
    int64_t calls; // number of calls of kn_ensemble_step so far
    int next;      // first state that no thread has taken
    int busy;      // number of threads that have not yet seen the end of the call
    bool leave;    // the threads end
    int steps;
    const kn_input *input;
    kn_output *output;
    kn_touch (*touch)[KN_PROBES_MAX];
};

static void step_state(kn_ensemble *e, kn_scratch *scratch, int i)
{
    const double dt_s = e->model->def.solver.dt_s;
    kn_input in = e->input[i];
    for (int s = 0; s < e->steps; s++) {
        if (kn_step(e->model, e->state[i], scratch, &in, &e->output[i]) != KN_OK) break;
        for (int p = 0; p < KN_PROBES_MAX; p++)
            for (int k = 0; k < 3; k++) in.probe[p].position_m[k] += dt_s * in.probe[p].velocity_m_s[k];
    }
    for (int p = 0; e->touch && p < KN_PROBES_MAX; p++)
        kn_touch_read(e->model, e->state[i], scratch, p, &e->touch[i][p]);
}

// Step states until all of them have been taken. The lock is held at the beginning and at the end.
static void work(kn_ensemble *e, kn_scratch *scratch)
{
    while (e->next < e->count) {
        const int i = e->next++;
        pthread_mutex_unlock(&e->lock);
        step_state(e, scratch, i);
        pthread_mutex_lock(&e->lock);
    }
}

static void *work_in_thread(void *self)
{
    worker *w = self;
    kn_ensemble *e = w->ensemble;
    int64_t seen = 0;
    pthread_mutex_lock(&e->lock);
    for (;;) {
        while (!e->leave && e->calls == seen) pthread_cond_wait(&e->begin, &e->lock);
        if (e->leave) break;
        seen = e->calls;
        work(e, w->scratch);
        if (--e->busy == 0) pthread_cond_signal(&e->end);
    }
    pthread_mutex_unlock(&e->lock);
    return NULL;
}

static bool start(kn_ensemble *e)
{
    bool fits = e->state && e->worker;
    for (int i = 0; fits && i < e->count; i++) fits = (e->state[i] = kn_state_create(e->model)) != NULL;
    for (int t = 0; fits && t < e->threads; t++) {
        worker *w = &e->worker[t];
        *w = (worker){.ensemble = e, .scratch = kn_scratch_create(e->model)};
        fits = w->scratch && (t == 0 || pthread_create(&w->thread, NULL, work_in_thread, w) == 0);
        e->started += fits && t > 0;
    }
    return fits;
}

kn_ensemble *kn_ensemble_create(const kn_model *model, int count, int threads)
{
    kn_ensemble *e = count > 0 && threads > 0 ? calloc(1, sizeof *e) : NULL;
    if (!e) return NULL;
    *e = (kn_ensemble){.model = model, .count = count, .threads = threads};
    pthread_mutex_init(&e->lock, NULL);
    pthread_cond_init(&e->begin, NULL);
    pthread_cond_init(&e->end, NULL);
    e->state = calloc((size_t)count, sizeof(kn_state *));
    e->worker = calloc((size_t)threads, sizeof *e->worker);
    if (start(e)) return e;
    kn_ensemble_destroy(e);
    return NULL;
}

void kn_ensemble_destroy(kn_ensemble *ensemble)
{
    kn_ensemble *e = ensemble;
    if (!e) return;
    pthread_mutex_lock(&e->lock);
    e->leave = true;
    pthread_cond_broadcast(&e->begin);
    pthread_mutex_unlock(&e->lock);
    for (int t = 1; t <= e->started; t++) pthread_join(e->worker[t].thread, NULL);
    for (int t = 0; e->worker && t < e->threads; t++) kn_scratch_destroy(e->worker[t].scratch);
    for (int i = 0; e->state && i < e->count; i++) kn_state_destroy(e->state[i]);
    pthread_mutex_destroy(&e->lock);
    pthread_cond_destroy(&e->begin);
    pthread_cond_destroy(&e->end);
    free(e->worker);
    free(e->state);
    free(e);
}

kn_state *kn_ensemble_state(kn_ensemble *ensemble, int number)
{
    return number >= 0 && number < ensemble->count ? ensemble->state[number] : NULL;
}

kn_status kn_ensemble_step(kn_ensemble *ensemble, int steps, const kn_input input[], kn_output output[],
                           kn_touch (*touch)[KN_PROBES_MAX])
{
    kn_ensemble *e = ensemble;
    if (steps < 1) return KN_BAD_INPUT;
    for (int i = 0; i < e->count; i++)
        if (!kn_input_fits(e->model, &input[i])) return KN_BAD_INPUT;
    pthread_mutex_lock(&e->lock);
    e->steps = steps, e->input = input, e->output = output, e->touch = touch;
    e->next = 0;
    e->busy = e->started;
    e->calls++;
    pthread_cond_broadcast(&e->begin);
    work(e, e->worker[0].scratch);
    while (e->busy > 0) pthread_cond_wait(&e->end, &e->lock);
    pthread_mutex_unlock(&e->lock);
    for (int i = 0; i < e->count; i++)
        if (e->state[i]->bad) return KN_DIVERGED;
    return KN_OK;
}
