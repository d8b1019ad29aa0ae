#include "server/backend/loss.h"

// Words and meanings of the reasons, indexed by kn_loss; the last entry means no loss.
static const struct {
    const char *word, *means;
} losses[KN_LOSS_COUNT + 1] = {
#define KN_LOSS_ROW(name, word, what) [KN_LOSS_##name] = {#word, what},
    KN_LOSSES(KN_LOSS_ROW)
#undef KN_LOSS_ROW
        [KN_LOSS_COUNT] = {"none", "in step"}};

const char *kn_loss_word(kn_loss loss) { return losses[loss].word; }
const char *kn_loss_means(kn_loss loss) { return losses[loss].means; }
