// Compare the Verilated link with server/backend/frame.c, byte for byte: replies, bus transfers in order, memory,
// counters. The lines carry requests, spoilt requests and noise, with gaps in the input, in the output and in the bus's
// answers. KN_CASES=N lines (1000), KN_SEED=N.
#include "Vknead_link.h"
#include "hdl/sim/circuit_bench.h"

// Share of the clocks without a transfer, in percent.
struct pauses {
    uint32_t in, out, bus;
};

struct link_circuit : circuit<Vknead_link> {
    memory words;
    std::vector<uint8_t> answer;
    bool waits = false; // a byte is offered at tx
    uint8_t waiting = 0;

    link_circuit() : circuit(1)
    {
        top->rst = 1;
        clock();
        top->rst = 0;
    }
    // Run one clock, with or without a byte offered. Return true when the byte was taken.
    bool run(chance &c, const pauses &p, const uint8_t *byte)
    {
        top->rx_valid = byte && c.below(100) >= p.in;
        top->rx_data = byte ? *byte : uint8_t(c.below(256));
        top->tx_ready = c.below(100) >= p.out;
        top->bus_ready = c.below(100) >= p.bus;
        settle();
        top->bus_rdata = c.word();
        top->bus_error = uint8_t(c.below(2));
        serve(*top, words.bus());
        if (waits && !(top->tx_valid && top->tx_data == waiting)) answer.push_back(0xee); // a byte that waits must stay
        waits = top->tx_valid && !top->tx_ready, waiting = top->tx_data;
        const bool taken = top->rx_valid && top->rx_ready;
        if (top->tx_valid && top->tx_ready) answer.push_back(top->tx_data);
        rise();
        return taken;
    }
};

// Return the first difference, or "" if there is none.
static std::string difference(const link_circuit &c, const reference &r)
{
    if (c.answer != r.answer) {
        size_t i = 0;
        while (i < c.answer.size() && i < r.answer.size() && c.answer[i] == r.answer[i]) i++;
        return "replies of " + std::to_string(c.answer.size()) + " and " + std::to_string(r.answer.size()) +
               " bytes differ from byte " + std::to_string(i);
    }
    if (c.words.transfers != r.words.transfers) return "other bus transfers";
    if (memcmp(c.words.words, r.words.words, sizeof c.words.words)) return "other memory";
    if (c.top->frames != uint32_t(r.framer.frames)) return "frames counted otherwise";
    if (c.top->crc_errors != uint32_t(r.framer.crc)) return "crc errors counted otherwise";
    if (c.top->cobs_errors != uint32_t(r.framer.cobs)) return "cobs errors counted otherwise";
    if (c.top->length_errors != uint32_t(r.framer.length)) return "length errors counted otherwise";
    return "";
}

int main()
{
    const long cases = from_environment("KN_CASES", 1000), seed = from_environment("KN_SEED", 1);
    long bytes = 0, answered = 0;
    chance c(static_cast<uint64_t>(seed));
    link_circuit it;
    reference model;
    printf("seed %ld\n", seed);
    for (long i = 0; i < cases; i++) {
        const pauses p = {c.below(3) * 45, c.below(3) * 45, c.below(3) * 45};
        std::vector<uint8_t> line = some_line(c);
        model.hear(line);
        for (size_t at = 0; at < line.size();) at += it.run(c, p, &line[at]);
        // Run until the answer is there, and then as long as one more frame would need to begin.
        uint64_t patience = it.clocks + 60000000, quiet = 0;
        while (it.answer.size() < model.answer.size() && it.clocks < patience) it.run(c, p, nullptr);
        while (quiet++ < 3000) it.run(c, p, nullptr);
        std::string wrong = difference(it, model);
        if (!wrong.empty()) {
            printf("FAIL line %ld (KN_SEED=%ld): %s\n", i, seed, wrong.c_str());
            return 1;
        }
        bytes += long(line.size()), answered += long(model.answer.size());
        it.answer.clear(), model.answer.clear();
        it.words.transfers.clear(), model.words.transfers.clear();
    }
    const kn_framer &f = model.framer;
    const long *statuses = model.statuses;
    printf("ok   %ld lines, %ld bytes: %lld frames, %lld crc, %lld cobs, %lld length\n", cases, bytes,
           (long long)f.frames, (long long)f.crc, (long long)f.cobs, (long long)f.length);
    printf("     answered %ld bytes: %ld ok, %ld malformed, %ld bus errors, %ld timeouts; %llu clocks\n", answered,
           statuses[0], statuses[1], statuses[2], statuses[3], (unsigned long long)it.clocks);
    bool tried = f.frames && f.crc && f.cobs && f.length && statuses[0] && statuses[1] && statuses[2] && statuses[3];
    if (cases < 1000 || tried) return 0;
    printf("FAIL not every counter and status was tried\n");
    return 1;
}
