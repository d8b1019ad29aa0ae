# Of what knead probe --motors wrote while its kneadd was killed and started again: around the last message of the old one, `at` (the
# ticks begin anew with the new one),
#
#     force_n F zero_ms N late N slope S after_n F fresh_mm Z next_mm Z tries N
#
# the force then, how long until 0 N, how many of its ticks gave any at `deadline` ms or later, most N/ms on the way, most N after the
# first 0 in the same try; how high the tool was when it touched first, in the first try and in the second. With -v deadline=MS; and -v shifted=FILE also ms since `at` and N, a row each.
BEGIN { FS = "," }
NR == 1 { next }
{
    n++
    ms[n] = 1e3 * $1; try[n] = $2; silent[n] = $11
    x[n] = $7; y[n] = $8; z[n] = $9
    f[n] = sqrt(x[n] ^ 2 + y[n] ^ 2 + z[n] ^ 2)
    if ($10 > 0 && fresh_mm == "") fresh_mm = 1e3 * $6
    if ($10 > 0 && $2 == 2 && next_mm == "") next_mm = 1e3 * $6
    if (!anew && n > 1 && $2 == try[n - 1] && $12 < tick) anew = n
    if (!anew && $2 > 1) anew = n
    tick = $12
}
END {
    for (at = anew - 1; at > 1 && silent[at] > 0; at--);
    for (i = at + 1; i <= n && try[i] == try[at]; i++) {
        s = sqrt((x[i] - x[i - 1]) ^ 2 + (y[i] - y[i - 1]) ^ 2 + (z[i] - z[i - 1]) ^ 2) / (ms[i] - ms[i - 1])
        if (s > slope) slope = s
        if (f[i] == 0 && zero == "") zero = ms[i] - ms[at]
        late += f[i] > 0 && ms[i] - ms[at] >= deadline
        if (zero != "" && f[i] > after) after = f[i]
    }
    if (shifted != "") for (i = 1; i <= n; i++) printf "%.0f %.6f\n", ms[i] - ms[at], f[i] >shifted
    printf "force_n %.3f zero_ms %.0f late %d slope %.3f after_n %.3f fresh_mm %.3f next_mm %.3f tries %d\n", f[at], zero, late, slope,
        after, fresh_mm, next_mm, try[n]
}
