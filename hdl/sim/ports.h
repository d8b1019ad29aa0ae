#ifndef KN_HDL_SIM_PORTS_H
#define KN_HDL_SIM_PORTS_H
// A host at a front end of the circuit: the word bus itself, the two wires of knead_top_uart bit by bit, or the
// AXI4-Lite cycles of knead_top_axi. KN_TOP_UART, KN_TOP_AXI or neither is defined.
#include "hdl/registers.h"
#include "hdl/sim/circuit_bench.h"
#if defined KN_TOP_UART
#include "Vknead_top_uart.h"

enum { SMALL = 1 };
struct device_port : serial_circuit<Vknead_top_uart> {
    uint16_t tag = 0;

    explicit device_port(int seed) : serial_circuit(seed, CLOCKS) // the circuit's own reset at power-up starts it
    {
        top->rst = 0;
        hold(1, 16 * CLOCKS);
    }
    bool transfer(bool write, uint32_t address, uint32_t *word)
    {
        kn_request request;
        kn_request_begin(&request, tag++);
        if (write) kn_request_write(&request, address, word, 1);
        else kn_request_read(&request, address, 1);
        answer.clear();
        for (uint8_t byte : frame_of(request.bytes, request.size)) send(byte);
        for (int waited = 0; answer.empty() || answer.back() != 0; waited++) {
            if (waited > 100000) lost("no reply");
            hold(1, 1);
        }
        kn_framer framer = {};
        kn_reply reply;
        size_t used, size = kn_framer_read(&framer, answer.data(), answer.size(), &used);
        if (!kn_reply_parse(&reply, &request, framer.bytes, size)) lost("no reply to what was asked");
        if (!write && reply.status == KN_REPLY_OK) *word = reply.words[0];
        if (reply.status != KN_REPLY_OK && reply.status != KN_REPLY_BUS) lost("a reply that tells neither");
        return reply.status == KN_REPLY_OK;
    }
};
#elif defined KN_TOP_AXI
#include "Vknead_top_axi.h"

enum { SMALL = 1 };
// A master that is always ready. hdl/formal/axi.v proves the slave for masters and parts of words of any kind.
struct device_port : circuit<Vknead_top_axi> {
    explicit device_port(int seed) : circuit(seed)
    {
        top->s_axi_aresetn = 0;
        top->s_axi_awvalid = top->s_axi_wvalid = top->s_axi_arvalid = 0;
        top->s_axi_bready = top->s_axi_rready = 1;
        top->s_axi_wstrb = 0xf;
        for (int i = 0; i < 4; i++) clock();
        top->s_axi_aresetn = 1;
    }
    void clock()
    {
        top->s_axi_aclk = 0;
        top->eval();
        top->s_axi_aclk = 1;
        top->eval();
        clocks++;
    }
    bool transfer(bool write, uint32_t address, uint32_t *word)
    {
        top->s_axi_awaddr = top->s_axi_araddr = address << 2;
        top->s_axi_wdata = *word;
        top->s_axi_awvalid = top->s_axi_wvalid = write;
        top->s_axi_arvalid = !write;
        clock();
        top->s_axi_awvalid = top->s_axi_wvalid = top->s_axi_arvalid = 0;
        for (int waited = 0; !(write ? top->s_axi_bvalid : top->s_axi_rvalid); waited++) {
            if (waited > 100) lost("no response");
            clock();
        }
        if (!write) *word = top->s_axi_rdata;
        const bool taken = (write ? top->s_axi_bresp : top->s_axi_rresp) == 0;
        clock(); // the clock in which the response is taken
        return taken;
    }
};
#else
#include "Vknead_engine.h"

enum { SMALL = 0 };
typedef word_bus<Vknead_engine> device_port;
#endif

// A host whose transfers are all taken.
struct host : device_port {
    using device_port::device_port;
    void access(bool write, uint32_t address, uint32_t *word)
    {
        if (transfer(write, address, word)) return;
        fprintf(stderr, "%s of 0x%06x refused\n", write ? "write" : "read", address);
        exit(1);
    }
    void put(uint32_t address, int64_t value)
    {
        uint32_t word = (uint32_t)value;
        access(true, address, &word);
    }
    uint32_t get(uint32_t address)
    {
        uint32_t word = 0;
        access(false, address, &word);
        return word;
    }
    void wait()
    {
        for (int polls = 0; get(KN_REG_STATUS) & KN_STATUS_BUSY; polls++)
            if (polls > 1 << 20) lost("busy for ever");
    }
};

#endif
