// Test the Verilated link on two wires. A sender whose clock is up to 3 % off gets the answer that frame.c gives, at
// any phase. Glitches of one clock change nothing. A break is one framing error and no byte. After noise the next frame
// behind a 0x00 is answered. KN_CASES=N of each (20), KN_SEED=N. CLOCKS is the parameter that the circuit was built
// with.
#include "Vknead_link_serial.h"
#include "hdl/sim/circuit_bench.h"

struct wires : serial_circuit<Vknead_link_serial> {
    memory words;
    reference twin; // the C code at the same line
    chance &c;
    bool glitches = false, stalled = false;
    int quiet = 0; // clocks since the last glitch

    explicit wires(chance &chance_) : serial_circuit(1, CLOCKS), c(chance_)
    {
        top->rst = 1;
        hold(1, 8);
        top->rst = 0;
        hold(1, 11 * CLOCKS); // what tx sent at power-up is over
    }
    void clock(bool level) override
    {
        top->rx = level;
        if (glitches && ++quiet > 8 && c.below(20) == 0) top->rx = !level, quiet = 0;
        top->bus_ready = !stalled && c.below(2);
        settle();
        serve(*top, words.bus());
        listen(top->tx);
        rise();
    }
    // Send bytes with random pauses.
    void send(const std::vector<uint8_t> &bytes, double rate = 1)
    {
        for (uint8_t byte : bytes) {
            serial_circuit::send(byte, rate);
            if (c.below(8) == 0) hold(1, c.below(1000) * 0.01 * bit / rate);
        }
    }
    void rest() // run until tx has been silent for long enough
    {
        for (size_t heard = SIZE_MAX; heard != answer.size();) {
            heard = answer.size();
            hold(1, 40 * CLOCKS + 4000);
        }
    }
};

static int failures;

static void expect(bool good, const char *sentence, const wires &w)
{
    printf("%s %s: frames %u crc %u cobs %u length %u framing %u overruns %u\n", good ? "ok  " : "FAIL", sentence,
           w.top->frames, w.top->crc_errors, w.top->cobs_errors, w.top->length_errors, w.top->framing_errors,
           w.top->overruns);
    failures += !good;
}

static std::vector<uint8_t> short_request(chance &c)
{
    kn_request r;
    uint32_t words[4] = {c.word(), c.word(), c.word(), c.word()}, address = 32 + c.below(200);
    kn_request_begin(&r, uint16_t(c.below(1 << 16)));
    kn_request_write(&r, address, words, 1 + c.below(4));
    kn_request_read(&r, address, 1 + c.below(4));
    return frame_of(r.bytes, r.size);
}

// Send random requests one at a time. Return the number of answers that equal those of the C code.
static long ask(wires &w, long count, double rate = 1)
{
    long answered = 0;
    for (long i = 0; i < count; i++) {
        std::vector<uint8_t> line = short_request(w.c);
        w.answer.clear(), w.twin.answer.clear();
        w.hold(1, w.c.below(100) * 0.01); // at any phase
        w.twin.hear(line);
        w.send(line, rate);
        w.rest();
        answered += w.answer == w.twin.answer;
    }
    return answered;
}

static void rates(chance &c, long cases)
{
    for (double rate : {0.97, 0.98, 0.99, 1.0, 1.01, 1.02, 1.03}) {
        wires w(c);
        char sentence[99];
        snprintf(sentence, sizeof sentence, "a sender at %.0f %% of the rate is answered", 100 * rate);
        expect(ask(w, cases, rate) == cases && w.top->framing_errors == 0, sentence, w);
    }
    for (double rate : {0.9, 1.1}) {
        wires w(c);
        ask(w, cases, rate);
        expect(w.top->frames < uint32_t(cases), "one that is 10 % off is not always understood", w);
    }
}

static void glitches(chance &c, long cases)
{
    wires w(c);
    w.glitches = true;
    expect(ask(w, cases) == cases && w.top->framing_errors == 0, "glitches of one clock change nothing", w);
}

static void breaks(chance &c, long cases)
{
    wires w(c);
    long answered = 0;
    for (long i = 0; i < cases; i++) {
        w.hold(0, CLOCKS * (11 + c.below(1000) * 0.1));
        w.hold(1, CLOCKS * 1.5);
        answered += ask(w, 1);
    }
    expect(answered == cases && w.top->framing_errors == uint32_t(cases) &&
               w.top->crc_errors + w.top->cobs_errors + w.top->length_errors == 0,
           "a break is one framing error and no byte", w);
}

static void noise(chance &c, long cases)
{
    wires w(c);
    long answered = 0;
    for (long i = 0; i < cases; i++) {
        for (int n = 0; n < 300; n++) w.hold(c.below(2), c.below(30) * 0.1 * CLOCKS + 0.1);
        w.hold(1, 11 * CLOCKS);
        w.send({0});
        w.rest();
        answered += ask(w, 1);
    }
    expect(answered == cases && w.top->frames == uint32_t(cases), "after noise a frame behind a 0x00 is answered", w);
}

static void floods(chance &c)
{
    wires w(c);
    w.stalled = true;
    for (int i = 0; i < 20; i++) w.send(short_request(c));
    expect(w.top->frames == 2 && w.top->overruns > 0, "of requests without a pause two are kept while the bus stands",
           w);
    w.stalled = false;
    w.rest();
    w.send({0});
    w.twin.words = w.words;
    expect(ask(w, 10) == 10 && w.top->frames == 12, "and once it goes on, those behind are answered", w);
}

int main()
{
    long cases = from_environment("KN_CASES", 20), seed = from_environment("KN_SEED", 1);
    chance c(static_cast<uint64_t>(seed));
    printf("seed %ld, %d clocks a bit\n", seed, CLOCKS);
    rates(c, cases);
    if (CLOCKS >= 8) glitches(c, cases);
    breaks(c, cases);
    noise(c, cases);
    floods(c);
    return failures != 0;
}
