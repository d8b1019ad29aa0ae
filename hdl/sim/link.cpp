// Compare the Verilated link with server/backend/frame.c, byte for byte: replies, bus transfers in order, memory,
// counters. The lines carry requests, spoilt requests and noise, with gaps in the input, in the output and in the bus's
// answers. KN_CASES=N lines (1000), KN_SEED=N.
#include "Vknead_link.h"
#include "hdl/sim/circuit_bench.h"

// Share of the clocks without a transfer, in percent.
struct pauses {
    uint32_t in, out, bus;
};

struct circuit {
    Vknead_link top;
    memory bus;
    std::vector<uint8_t> answer;
    uint64_t clocks = 0;
    bool waits = false; // a byte is offered at tx
    uint8_t waiting = 0;

    void edge()
    {
        top.clk = 0;
        top.eval();
        top.clk = 1;
        top.eval();
        clocks++;
    }
    circuit()
    {
        top.rst = 1;
        edge();
        top.rst = 0;
    }
    // Run one clock, with or without a byte offered. Return true when the byte was taken.
    bool clock(chance &c, const pauses &p, const uint8_t *byte)
    {
        top.rx_valid = byte && c.below(100) >= p.in;
        top.rx_data = byte ? *byte : uint8_t(c.below(256));
        top.tx_ready = c.below(100) >= p.out;
        top.bus_ready = c.below(100) >= p.bus;
        top.clk = 0;
        top.eval();
        top.bus_rdata = c.word();
        top.bus_error = uint8_t(c.below(2));
        if (top.bus_valid && top.bus_ready) transfer();
        if (waits && !(top.tx_valid && top.tx_data == waiting)) answer.push_back(0xee); // a byte that waits must stay
        waits = top.tx_valid && !top.tx_ready, waiting = top.tx_data;
        bool taken = top.rx_valid && top.rx_ready;
        if (top.tx_valid && top.tx_ready) answer.push_back(top.tx_data);
        edge();
        return taken;
    }
    void transfer()
    {
        uint32_t word = top.bus_rdata;
        top.bus_error = !(top.bus_write ? bus.write(top.bus_addr, top.bus_wdata) : bus.read(top.bus_addr, word));
        top.bus_rdata = word;
    }
};

// Return the first difference, or "" if there is none.
static std::string difference(const circuit &c, const device &d)
{
    if (c.answer != d.answer) {
        size_t i = 0;
        while (i < c.answer.size() && i < d.answer.size() && c.answer[i] == d.answer[i]) i++;
        return "replies of " + std::to_string(c.answer.size()) + " and " + std::to_string(d.answer.size()) +
               " bytes differ from byte " + std::to_string(i);
    }
    if (c.bus.transfers != d.bus.transfers) return "other bus transfers";
    if (memcmp(c.bus.words, d.bus.words, sizeof c.bus.words)) return "other memory";
    if (c.top.frames != uint32_t(d.framer.frames)) return "frames counted otherwise";
    if (c.top.crc_errors != uint32_t(d.framer.crc)) return "crc errors counted otherwise";
    if (c.top.cobs_errors != uint32_t(d.framer.cobs)) return "cobs errors counted otherwise";
    if (c.top.length_errors != uint32_t(d.framer.length)) return "length errors counted otherwise";
    return "";
}

int main()
{
    long cases = from_environment("KN_CASES", 1000), seed = from_environment("KN_SEED", 1), bytes = 0, answered = 0;
    chance c = {0x9e3779b97f4a7c15u * uint64_t(seed + 1)};
    circuit it;
    device model;
    printf("seed %ld\n", seed);
    for (long i = 0; i < cases; i++) {
        const pauses p = {c.below(3) * 45, c.below(3) * 45, c.below(3) * 45};
        std::vector<uint8_t> line = some_line(c);
        model.hear(line);
        for (size_t at = 0; at < line.size();) at += it.clock(c, p, &line[at]);
        // Run until the answer is there, and then as long as one more frame would need to begin.
        uint64_t patience = it.clocks + 60000000, quiet = 0;
        while (it.answer.size() < model.answer.size() && it.clocks < patience) it.clock(c, p, nullptr);
        while (quiet++ < 3000) it.clock(c, p, nullptr);
        std::string wrong = difference(it, model);
        if (!wrong.empty()) {
            printf("FAIL line %ld (KN_SEED=%ld): %s\n", i, seed, wrong.c_str());
            return 1;
        }
        bytes += long(line.size()), answered += long(model.answer.size());
        it.answer.clear(), model.answer.clear();
        it.bus.transfers.clear(), model.bus.transfers.clear();
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
