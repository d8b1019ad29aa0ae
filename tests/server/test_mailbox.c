#include "server/mailbox.h"
#include "tests/check.h"
#include <pthread.h>
#include <stdint.h>

typedef struct letter { // all words are equal, unless the letter was torn
    uint64_t word[32];
} letter;

TEST("the reader gets the latest letter, and the same letter again until a newer one arrives")
{
    static letter memory[3];
    kn_mailbox box;
    bool fresh;
    kn_mailbox_init(&box, memory, sizeof memory[0]);
    const letter *read = kn_mailbox_latest(&box, &fresh);
    CHECK(!fresh && read->word[0] == 0);
    for (uint64_t n = 1; n <= 5; n++) {
        *(letter *)kn_mailbox_back(&box) = (letter){{n}};
        kn_mailbox_post(&box);
    }
    read = kn_mailbox_latest(&box, &fresh);
    CHECK(fresh && read->word[0] == 5);
    CHECK(kn_mailbox_latest(&box, &fresh) == read && !fresh);
}

enum { LETTERS = 200000 };

// The writer thread.
static void *write_letters(void *box)
{
    for (uint64_t n = 1; n <= LETTERS; n++) {
        letter *back = kn_mailbox_back(box);
        for (int i = 0; i < 32; i++) back->word[i] = n;
        kn_mailbox_post(box);
    }
    return NULL;
}

TEST("between two threads letters are never torn or out of order, and the last letter arrives")
{
    static letter memory[3];
    kn_mailbox box;
    kn_mailbox_init(&box, memory, sizeof memory[0]);
    pthread_t writer;
    CHECK(pthread_create(&writer, NULL, write_letters, &box) == 0);
    uint64_t last = 0, torn = 0, backwards = 0;
    while (last < LETTERS) {
        bool fresh;
        const letter *read = kn_mailbox_latest(&box, &fresh);
        for (int i = 1; i < 32; i++) torn += read->word[i] != read->word[0];
        backwards += read->word[0] < last || (fresh && read->word[0] == last);
        last = read->word[0];
    }
    pthread_join(writer, NULL);
    CHECK(torn == 0);
    CHECK(backwards == 0);
}

TESTS_MAIN
