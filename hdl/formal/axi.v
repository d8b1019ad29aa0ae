`default_nettype none
// AXI4-Lite of knead_top_axi, with anything for an engine behind it. Each request gets one response, which stays until
// it is taken, and there is no response without a request. The engine's bus gets what was asked, once, never part of a
// word, and it stays there until it is answered.
module axi (
    input wire        clk,
    input wire        resetn,
    input wire [25:0] awaddr, araddr,
    input wire [31:0] data,
    input wire [ 3:0] strb,
    input wire        awvalid, wvalid, bready, arvalid, rready
);
    wire        awready, wready, bvalid, arready, rvalid;
    wire [ 1:0] bresp, rresp;
    wire [31:0] rdata;
    knead_top_axi dut (
        .s_axi_aclk(clk), .s_axi_aresetn(resetn), .s_axi_awaddr(awaddr), .s_axi_awvalid(awvalid),
        .s_axi_awready(awready), .s_axi_wdata(data), .s_axi_wstrb(strb), .s_axi_wvalid(wvalid), .s_axi_wready(wready),
        .s_axi_bresp(bresp), .s_axi_bvalid(bvalid), .s_axi_bready(bready), .s_axi_araddr(araddr),
        .s_axi_arvalid(arvalid), .s_axi_arready(arready), .s_axi_rdata(rdata), .s_axi_rresp(rresp),
        .s_axi_rvalid(rvalid), .s_axi_rready(rready));

    wire        valid, write; // peek: dut.engine.bus_valid dut.engine.bus_write
    wire        ready, refused; // peek: dut.engine.bus_ready dut.engine.bus_error
    wire [23:0] addr; // peek: dut.engine.bus_addr
    wire [31:0] wdata, word; // peek: dut.engine.bus_wdata dut.engine.bus_rdata

    reg         begun, writing, reading, part, asked; // asked: the engine's bus has not answered yet
    reg  [23:0] address;
    reg  [31:0] sent, got;
    reg         wrong;
    reg  [ 1:0] waited;
    initial begun = 1'b0;
    wire        take = awvalid && awready;
    wire        take_read = arvalid && arready;
    always @(posedge clk) begin
        begun <= 1'b1;
        if (take) {writing, part, asked, address, sent} <= {1'b1, strb != 4'hf, strb == 4'hf, awaddr[25:2], data};
        if (take_read) {reading, part, asked, address} <= {1'b1, 1'b0, 1'b1, araddr[25:2]};
        if (valid && ready) {asked, got, wrong} <= {1'b0, word, refused};
        if (bvalid && bready) writing <= 1'b0;
        if (rvalid && rready) reading <= 1'b0;
        waited <= valid && !ready ? waited + 2'd1 : 2'd0;
        if (!resetn) {writing, reading, part, asked, waited} <= 6'd0;
    end

    always @* if (!begun) assume (!resetn);
    always @* begin
        if (!valid) assume (!ready);
        if (waited == 2'd2) assume (ready);
    end
    always @* if (begun && resetn) begin
        assert (awready == wready);
        assert (!take || wvalid);
        assert (!(take && take_read));
        assert (!(writing && reading));
        assert (!((take || take_read) && (writing || reading)));
        assert (valid == asked);
        assert (!asked || (writing || reading) && !part);
        if (valid) assert (write == writing && addr == address && (!write || wdata == sent));
        assert (bvalid == (writing && !asked));
        assert (rvalid == (reading && !asked));
        if (bvalid) assert (bresp == (part || wrong ? 2'b10 : 2'b00));
        if (rvalid) assert (rresp == (wrong ? 2'b10 : 2'b00) && rdata == got);
    end
    always @(posedge clk) begin
        cover (begun && resetn && bvalid && bresp == 2'b10 && part);
        cover (begun && resetn && rvalid && rdata == 32'h12345678 && rresp == 2'b00 && address == 24'hfedcba);
    end
endmodule
`default_nettype wire
