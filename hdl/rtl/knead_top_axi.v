`default_nettype none
// The engine as an AXI4-Lite slave of 32-bit words: byte address 4 x word address, 2^26 bytes. A write of part of a
// word and a refused transfer are answered with SLVERR. There is one transfer at a time. A write goes before a read
// that came in the same clock.
//
// A vendor's PCIe endpoint (Xilinx XDMA or AXI bridge with its AXI4-Lite master, a LitePCIe wishbone bridge behind an
// adapter) belongs in front of s_axi: BAR0 = 64 MiB, translated to 0. This design contains no endpoint.
module knead_top_axi #(
    parameter LOG_NODES = 10,
    parameter LOG_EDGES = 13,
    parameter LOG_LIST = 6
) (
    input  wire        s_axi_aclk,
    input  wire        s_axi_aresetn,
    input  wire [25:0] s_axi_awaddr,
    input  wire        s_axi_awvalid,
    output wire        s_axi_awready,
    input  wire [31:0] s_axi_wdata,
    input  wire [ 3:0] s_axi_wstrb,
    input  wire        s_axi_wvalid,
    output wire        s_axi_wready,
    output reg  [ 1:0] s_axi_bresp,
    output reg         s_axi_bvalid,
    input  wire        s_axi_bready,
    input  wire [25:0] s_axi_araddr,
    input  wire        s_axi_arvalid,
    output wire        s_axi_arready,
    output reg  [31:0] s_axi_rdata,
    output reg  [ 1:0] s_axi_rresp,
    output reg         s_axi_rvalid,
    input  wire        s_axi_rready
);
    localparam [1:0] OKAY = 2'b00, SLVERR = 2'b10;
    reg         valid, write;
    reg  [23:0] addr;
    reg  [31:0] wdata;
    wire        ready, refused;
    wire [31:0] rdata;
    wire        rest = !valid && !s_axi_bvalid && !s_axi_rvalid; // no transfer under way
    wire        take_write = rest && s_axi_awvalid && s_axi_wvalid;
    wire        take_read = rest && s_axi_arvalid && !take_write;
    wire        whole = s_axi_wstrb == 4'hf;
    assign s_axi_awready = take_write;
    assign s_axi_wready = take_write;
    assign s_axi_arready = take_read;

    always @(posedge s_axi_aclk) begin
        if (take_write || take_read) begin
            valid <= take_read || whole;
            write <= take_write;
            addr <= take_write ? s_axi_awaddr[25:2] : s_axi_araddr[25:2];
            wdata <= s_axi_wdata;
        end
        if (take_write && !whole) begin
            s_axi_bvalid <= 1'b1;
            s_axi_bresp <= SLVERR;
        end
        if (valid && ready) begin
            valid <= 1'b0;
            s_axi_bvalid <= write;
            s_axi_rvalid <= !write;
            s_axi_bresp <= refused ? SLVERR : OKAY;
            s_axi_rresp <= refused ? SLVERR : OKAY;
            s_axi_rdata <= rdata;
        end
        if (s_axi_bvalid && s_axi_bready) s_axi_bvalid <= 1'b0;
        if (s_axi_rvalid && s_axi_rready) s_axi_rvalid <= 1'b0;
        if (!s_axi_aresetn) {valid, s_axi_bvalid, s_axi_rvalid} <= 3'd0;
    end

    knead_engine #(.LOG_NODES(LOG_NODES), .LOG_EDGES(LOG_EDGES), .LOG_LIST(LOG_LIST)) engine (
        .clk(s_axi_aclk), .rst(!s_axi_aresetn), .bus_valid(valid), .bus_write(write), .bus_addr(addr),
        .bus_wdata(wdata), .bus_ready(ready), .bus_rdata(rdata), .bus_error(refused));
    wire unused = &{s_axi_awaddr[1:0], s_axi_araddr[1:0]};
endmodule
`default_nettype wire
