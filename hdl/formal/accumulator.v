`default_nettype none
// Any cell of the sums is the plain sum of what was added to it since it was last taken, for any order of addresses.
// The proof compares knead_accumulator with its forwarding to a register that adds.
module accumulator (
    input wire       clk, add, take,
    input wire [1:0] address,
    input wire [8:0] value // three components of three bits
);
    wire [17:0] sum;
    knead_accumulator #(.WIDTH(6), .VALUE(3), .LOG_DEPTH(2)) dut (
        .clk(clk), .i_add(add), .i_take(take), .i_address(address), .i_value(value), .o_sum(sum));

    wire [ 1:0] watched; // peek: dut.ram.watched
    wire [17:0] held; // peek: dut.ram.held

    reg  [17:0] plain; // the watched sum, after all additions that have left the pipe
    reg  [ 1:0] address_r;
    reg  [ 8:0] value_r;
    reg         add_r, take_r, known, again; // known: taken once; before that the cell's content is undefined
    initial {add_r, take_r, known, again} = 4'd0;
    wire        here = address_r == watched;
    integer k;
    always @(posedge clk) begin
        address_r <= address;
        value_r <= value;
        add_r <= add;
        take_r <= take;
        again <= here && add_r && !take_r && add && address == watched; // two additions in a row
        if (here && take_r) begin
            plain <= 18'd0;
            known <= 1'b1;
        end else if (here && add_r)
            for (k = 0; k < 3; k = k + 1)
                plain[6*k +: 6] <= plain[6*k +: 6] + {{3{value_r[3*k+2]}}, value_r[3*k +: 3]};
        cover (known && again && plain == 18'h3f0fc);
    end
    always @* if (known) begin
        assert (held == plain);
        if (here) assert (sum == plain);
    end
endmodule
`default_nettype wire
