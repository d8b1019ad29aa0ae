// Test the Verilated link on two wires. A sender whose clock is up to 3 % off gets the answer that frame.c gives, at
// any phase. Glitches of one clock change nothing. A break is one framing error and no byte. After noise the next frame
// behind a 0x00 is answered. KN_CASES=N of each (20), KN_SEED=N. CLOCKS is the parameter that the circuit was built
// with.
#include "Vknead_link_serial.h"
#include "hdl/sim/circuit_bench.h"

struct wires {
    VerilatedContext context;
    Vknead_link_serial top{&context};
    memory bus;
    chance &c;
    double now = 0, until = 0; // clocks; the level of the line is known up to `until`
    bool glitches = false, stalled = false;
    int quiet = 0;            // clocks since the last glitch
    int phase = -1, bits = 0; // of the byte that tx sends
    std::vector<uint8_t> answer;

    explicit wires(chance &chance_) : c(chance_)
    {
        top.rst = 1;
        hold(1, 8);
        top.rst = 0;
    }
    void clock(bool level)
    {
        top.rx = level;
        if (glitches && ++quiet > 8 && c.below(20) == 0) top.rx = !level, quiet = 0;
        top.bus_ready = !stalled && c.below(2);
        top.clk = 0;
        top.eval();
        if (top.bus_valid && top.bus_ready) transfer();
        if (!top.rst) listen(top.tx);
        top.clk = 1;
        top.eval();
        now++;
    }
    void transfer()
    {
        uint32_t word = 0;
        top.bus_error = !(top.bus_write ? bus.write(top.bus_addr, top.bus_wdata) : bus.read(top.bus_addr, word));
        top.bus_rdata = word;
    }
    // Receive a byte at tx: sample each bit in its middle; phase counts clocks since the start bit began.
    void listen(bool level)
    {
        if (phase < 0 && level) return;
        phase++;
        if (phase % CLOCKS != CLOCKS / 2 || phase < CLOCKS) return;
        if (phase < 9 * CLOCKS) {
            bits = bits >> 1 | level << 7;
            return;
        }
        answer.push_back(uint8_t(bits));
        if (!level) answer.push_back(0xee), printf("FAIL no stop bit at tx\n");
        phase = -1;
    }
    void hold(bool level, double clocks)
    {
        until += clocks;
        while (now < until) clock(level);
    }
    // Send bytes at a rate relative to the nominal one, with random pauses.
    void send(const std::vector<uint8_t> &bytes, double rate)
    {
        const double bit = CLOCKS / rate;
        for (uint8_t byte : bytes) {
            hold(0, bit);
            for (int i = 0; i < 8; i++) hold(byte >> i & 1, bit);
            hold(1, bit);
            if (c.below(8) == 0) hold(1, c.below(1000) * 0.01 * bit);
        }
    }
    void rest() // run until tx has been silent for long enough
    {
        size_t heard = answer.size();
        do {
            heard = answer.size();
            hold(1, 40 * CLOCKS + 4000);
        } while (answer.size() != heard);
    }
    std::string counters() const
    {
        char text[99];
        snprintf(text, sizeof text, "frames %u crc %u cobs %u length %u framing %u overruns %u", top.frames,
                 top.crc_errors, top.cobs_errors, top.length_errors, top.framing_errors, top.overruns);
        return text;
    }
};

static int failures;

static void expect(bool good, const char *sentence, const wires &w)
{
    printf("%s %s: %s\n", good ? "ok  " : "FAIL", sentence, w.counters().c_str());
    failures += !good;
}

static std::vector<uint8_t> short_request(chance &c)
{
    kn_request r;
    uint32_t words[4] = {c.word(), c.word(), c.word(), c.word()}, address = 32 + c.below(200);
    kn_request_begin(&r, uint16_t(c.below(1 << 16)));
    kn_request_write(&r, address, words, 1 + c.below(4));
    kn_request_read(&r, address, 1 + c.below(4));
    uint8_t wire[KN_FRAMER_WIRE];
    size_t size = kn_framer_encode(r.bytes, r.size, wire);
    return {wire, wire + size};
}

// Send random requests one at a time. Return the number of answers that equal those of the C code.
static long ask(wires &w, device &d, long count, double rate)
{
    long answered = 0;
    for (long i = 0; i < count; i++) {
        std::vector<uint8_t> line = short_request(w.c);
        w.answer.clear(), d.answer.clear();
        w.hold(1, w.c.below(100) * 0.01); // at any phase
        d.hear(line);
        w.send(line, rate);
        w.rest();
        answered += w.answer == d.answer;
    }
    return answered;
}

static void rates(chance &c, long cases)
{
    for (double rate : {0.97, 0.98, 0.99, 1.0, 1.01, 1.02, 1.03}) {
        wires w(c);
        device d;
        char sentence[99];
        snprintf(sentence, sizeof sentence, "a sender at %.0f %% of the rate is answered", 100 * rate);
        expect(ask(w, d, cases, rate) == cases && w.top.framing_errors == 0, sentence, w);
    }
    for (double rate : {0.9, 1.1}) {
        wires w(c);
        device d;
        ask(w, d, cases, rate);
        expect(w.top.frames < uint32_t(cases), "one that is 10 % off is not always understood", w);
    }
}

static void glitches(chance &c, long cases)
{
    wires w(c);
    device d;
    w.glitches = true;
    expect(ask(w, d, cases, 1) == cases && w.top.framing_errors == 0, "glitches of one clock change nothing", w);
}

static void breaks(chance &c, long cases)
{
    wires w(c);
    device d;
    long answered = 0;
    for (long i = 0; i < cases; i++) {
        w.hold(0, CLOCKS * (11 + c.below(1000) * 0.1));
        w.hold(1, CLOCKS * 1.5);
        answered += ask(w, d, 1, 1);
    }
    expect(answered == cases && w.top.framing_errors == uint32_t(cases) &&
               w.top.crc_errors + w.top.cobs_errors + w.top.length_errors == 0,
           "a break is one framing error and no byte", w);
}

static void noise(chance &c, long cases)
{
    wires w(c);
    device d;
    long answered = 0;
    for (long i = 0; i < cases; i++) {
        for (int n = 0; n < 300; n++) w.hold(c.below(2), c.below(30) * 0.1 * CLOCKS + 0.1);
        w.hold(1, 11 * CLOCKS);
        w.send({0}, 1);
        w.rest();
        answered += ask(w, d, 1, 1);
    }
    expect(answered == cases && w.top.frames == uint32_t(cases), "after noise a frame behind a 0x00 is answered", w);
}

static void floods(chance &c)
{
    wires w(c);
    device d;
    w.stalled = true;
    for (int i = 0; i < 20; i++) w.send(short_request(c), 1);
    expect(w.top.frames == 2 && w.top.overruns > 0, "of requests without a pause two are kept while the bus stands", w);
    w.stalled = false;
    w.rest();
    w.send({0}, 1);
    d.bus = w.bus;
    expect(ask(w, d, 10, 1) == 10 && w.top.frames == 12, "and once it goes on, those behind are answered", w);
}

int main()
{
    long cases = from_environment("KN_CASES", 20), seed = from_environment("KN_SEED", 1);
    chance c = {0x9e3779b97f4a7c15u * uint64_t(seed + 1)};
    printf("seed %ld, %d clocks a bit\n", seed, CLOCKS);
    rates(c, cases);
    if (CLOCKS >= 8) glitches(c, cases);
    breaks(c, cases);
    noise(c, cases);
    floods(c);
    return failures != 0;
}
