#include "clients/knead/player.h"
#include <math.h>

// Publish the state of the hand for other threads.
static void tell(kn_player *p)
{
    const double *f = p->hand.given_n;
    atomic_store(&p->path_ms, (int)lround(1e3 * p->hand.path_s));
    atomic_store(&p->given_mn, (int)lround(1e3 * sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2])));
    atomic_store(&p->piece, p->hand.piece);
    atomic_store(&p->tries, p->hand.tries);
    atomic_store(&p->trips, p->hand.trips);
    // Stored last, so the other values are valid when another thread sees the new mode.
    atomic_store(&p->mode, (int)p->hand.mode);
}

void kn_player_init(kn_player *p, const kn_hand_def *def)
{
    kn_hand_init(&p->hand, def);
    tell(p);
}

kn_hand_out kn_player_tick(void *self, const kn_hand_force *force, int elapsed_ms)
{
    kn_player *p = self;
    // Between two tries, take over the path that another thread has made for the next one.
    if (p->hand.mode == KN_HAND_SILENT && atomic_load(&p->next_path))
        kn_hand_take_path(&p->hand, atomic_exchange(&p->next_path, NULL));
    kn_hand_out out = kn_hand_tick(&p->hand, force, elapsed_ms);
    if (!p->gripped) kn_motors_add(&p->motors, &p->hand, p->hand.point.position_m, p->hand.given_n, elapsed_ms);
    tell(p);
    return out;
}
