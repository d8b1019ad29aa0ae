#ifndef KN_HDL_SIM_PORTS_H
#define KN_HDL_SIM_PORTS_H
// Access to a word of the circuit through a front end: the word bus itself, the two wires of knead_top_uart bit by bit,
// or the AXI4-Lite cycles of knead_top_axi. KN_TOP_UART, KN_TOP_AXI or neither is defined.
#include <cstdio>
#include <cstdlib>

#include "hdl/sim/word_bus.h"
#if defined KN_TOP_UART
#include "Vknead_top_uart.h"
typedef Vknead_top_uart circuit_top;
extern "C" {
#include "server/backend/frame.h"
}
#elif defined KN_TOP_AXI
#include "Vknead_top_axi.h"
typedef Vknead_top_axi circuit_top;
#else
#include "Vknead_engine.h"
typedef Vknead_engine circuit_top;
#endif

[[noreturn]] inline void lost(const char *what)
{
    fprintf(stderr, "%s\n", what);
    exit(1);
}

#if defined KN_TOP_UART
struct device_port : circuit<circuit_top> {
    kn_framer framer = {};
    uint16_t tag = 0;
    int phase = -1, bits = 0; // clock within the byte at tx, and its bits so far
    bool heard = false;
    kn_request asked;
    kn_reply reply;

    explicit device_port(int seed) : circuit(seed) // the circuit's own reset at power-up starts it
    {
        top->rst = 0;
        hold(1, 64);
    }
    void clock(bool level)
    {
        top->rx = level;
        top->clk = 0;
        top->eval();
        listen(top->tx);
        top->clk = 1;
        top->eval();
        clocks++;
    }
    void hold(bool level, int count)
    {
        while (count-- > 0) clock(level);
    }
    // Receive a byte at tx: sample each bit in its middle.
    void listen(bool level)
    {
        if (phase < 0 && level) return;
        phase++;
        if (phase % KN_CLOCKS != KN_CLOCKS / 2 || phase < KN_CLOCKS) return;
        if (phase < 9 * KN_CLOCKS) {
            bits = bits >> 1 | level << 7;
            return;
        }
        if (!level) lost("no stop bit at tx");
        phase = -1;
        take(uint8_t(bits));
    }
    void take(uint8_t byte)
    {
        size_t used, size = kn_framer_read(&framer, &byte, 1, &used);
        if (size == 0) return;
        if (!kn_reply_parse(&reply, &asked, framer.bytes, size)) lost("no reply to what was asked");
        heard = true;
    }
    void send(uint8_t byte)
    {
        hold(0, KN_CLOCKS);
        for (int k = 0; k < 8; k++) hold(byte >> k & 1, KN_CLOCKS);
        hold(1, KN_CLOCKS);
    }
    bool transfer(bool write, uint32_t address, uint32_t *word)
    {
        uint8_t wire[KN_FRAMER_WIRE];
        kn_request_begin(&asked, tag++);
        if (write) kn_request_write(&asked, address, word, 1);
        else kn_request_read(&asked, address, 1);
        heard = false;
        const size_t size = kn_framer_encode(asked.bytes, asked.size, wire);
        for (size_t i = 0; i < size; i++) send(wire[i]);
        for (int waited = 0; !heard; waited++) {
            if (waited > 100000) lost("no reply");
            clock(1);
        }
        if (!write && reply.status == KN_REPLY_OK) *word = reply.words[0];
        if (reply.status != KN_REPLY_OK && reply.status != KN_REPLY_BUS) lost("a reply that tells neither");
        return reply.status == KN_REPLY_OK;
    }
};
#elif defined KN_TOP_AXI
struct device_port : circuit<circuit_top> {
    uint32_t gaps = 1; // state of the random gaps that a master makes

    explicit device_port(int seed) : circuit(seed)
    {
        top->s_axi_aresetn = 0;
        top->s_axi_awvalid = top->s_axi_wvalid = top->s_axi_bready = top->s_axi_arvalid = top->s_axi_rready = 0;
        for (int i = 0; i < 4; i++) clock();
        top->s_axi_aresetn = 1;
        uint32_t part = 0; // writing part of a word must be refused and write nothing
        if (write_word(7, 0x12345678, 0x7) || !read_word(7, &part) || part != 0) lost("part of a word was taken");
    }
    void clock()
    {
        top->s_axi_aclk = 0;
        top->eval();
        top->s_axi_aclk = 1;
        top->eval();
        clocks++;
    }
    uint32_t gap() // xorshift
    {
        gaps ^= gaps << 13, gaps ^= gaps >> 17, gaps ^= gaps << 5;
        return gaps % 4;
    }
    void rest()
    {
        for (uint32_t n = gap(); n > 0; n--) clock();
    }
    template <typename ready> void until(ready is_ready, const char *what)
    {
        for (int waited = 0;; waited++) {
            if (waited > 100) lost(what);
            top->s_axi_aclk = 0;
            top->eval();
            const bool taken = is_ready();
            top->s_axi_aclk = 1;
            top->eval();
            clocks++;
            if (taken) return;
        }
    }
    bool write_word(uint32_t address, uint32_t word, uint8_t strobe)
    {
        top->s_axi_awaddr = address << 2;
        top->s_axi_awvalid = 1;
        if (gap() == 0) rest(); // address before data
        top->s_axi_wdata = word;
        top->s_axi_wstrb = strobe;
        top->s_axi_wvalid = 1;
        until([&] { return top->s_axi_awready && top->s_axi_wready; }, "no awready");
        top->s_axi_awvalid = top->s_axi_wvalid = 0;
        rest();
        top->s_axi_bready = 1;
        uint8_t response = 0;
        until([&] { return response = top->s_axi_bresp, top->s_axi_bvalid; }, "no bvalid");
        top->s_axi_bready = 0;
        return response == 0;
    }
    bool read_word(uint32_t address, uint32_t *word)
    {
        top->s_axi_araddr = address << 2;
        top->s_axi_arvalid = 1;
        until([&] { return top->s_axi_arready; }, "no arready");
        top->s_axi_arvalid = 0;
        rest();
        top->s_axi_rready = 1;
        uint8_t response = 0;
        until([&] { return response = top->s_axi_rresp, *word = top->s_axi_rdata, top->s_axi_rvalid; }, "no rvalid");
        top->s_axi_rready = 0;
        return response == 0;
    }
    bool transfer(bool write, uint32_t address, uint32_t *word)
    {
        return write ? write_word(address, *word, 0xf) : read_word(address, word);
    }
};
#else
typedef word_bus<circuit_top> device_port;
#endif

#endif
