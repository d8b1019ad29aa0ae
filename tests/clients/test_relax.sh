#!/usr/bin/env bash
# knead relax, sweep and tpa compared with closed forms, and one line for each refusal.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"

near() { awk -v a="$1" -v b="$2" -v bound="${3:-1e-4}" 'BEGIN { d = a / b - 1; exit !(d < bound && d > -bound) }'; }

# A Maxwell unit: E e^(-t/tau), tau = 2 s. Half remains after 1.386 s, and tan = 1/(omega tau).
maxwell=(maxwell --param s1='10 kPa' --param d1='20 kPa*s')
knead relax "${maxwell[@]}" --strain 10% --hold 20 --csv relax.csv --png relax.png >out || fail "relax maxwell: exit $?"
read -r _ peak held last half e tenth < <(grep '^element' out)
near "$peak" 1000 && near "$held" 1000 && near "$half" 1.386 1e-3 && near "$e" 2 1e-3 && near "$tenth" 4.605 1e-3 || fail "maxwell: $(grep '^element' out)"
awk -F, 'NR > 1 { e = 1000 * exp(-$2 / 2); if ($4 < e * (1 - 2e-6) || $4 > e * (1 + 2e-6)) exit 1 }' relax.csv || fail "the CSV curve of maxwell differs from the closed form"
knead sweep "${maxwell[@]}" --frequency 0.01:1:3 --csv sweep.csv --png sweep.png >out || fail "sweep maxwell: exit $?"
knead sweep "${maxwell[@]}" --frequency 0.01:1:3 --amplitude 1% --csv swung.csv >out || fail "swung maxwell: exit $?"
for file in sweep.csv swung.csv; do
    awk -F, -v pi=3.14159265358979 'NR > 1 { x = 4 * pi * $1; s = 1e4 * x * x / (1 + x * x); l = 1e4 * x / (1 + x * x)
        if ($2 < s * 0.9999 || $2 > s * 1.0001 || $3 < l * 0.9999 || $3 > l * 1.0001) exit 1 }' $file || fail "$file: $(cat $file)"
done
png relax.png && png sweep.png || fail "no PNG"

# Dough: small oscillations are linear, larger ones thin the dough.
knead sweep dough --frequency 0.01:1:3 --amplitude 1e-4 >small && knead sweep dough --frequency 0.01:1:3 >linear || fail "sweep dough"
paste <(grep '^ *[0-9]' small) <(grep '^ *[0-9]' linear) >both # 5 columns of each table, side by side
[ "$(wc -l <both)" = 3 ] && awk '{ a = $2 / $7 - 1; b = $3 / $8 - 1; if (a * a > 1e-6 || b * b > 1e-6) exit 1 }' both || fail "small swings are not linear: $(cat both)"
knead sweep dough --frequency 1:2:2 --amplitude 1% >out
awk '$1 == "1" { thin = $3 } END { exit !(thin < 1e6) }' out || fail "dough does not thin: $(cat out)"
begun=yes refuses 2 "knead relax: dough: (s1|d1)-d2: responds as a dashpot at first, so a step of strain needs an infinite stress, expected --ramp RATE, e.g. --ramp 10%/s" relax dough
refuses 2 "knead relax: --ramp 5: expected a strain per second like 10%/s, or a speed like '1 mm/s'" relax dough --ramp 5
refuses 2 "knead relax: --strain 150%: expected a share of the height between 0 and 100 %, like 10%" relax dough --strain 150%
refuses 2 "knead relax: --lattice: a plate cannot jump, expected --ramp RATE, e.g. --ramp 10%/s" relax s --param s1=1kPa --lattice 2x2x2
refuses 2 "knead sweep: --frequency 5:1: expected LOW:HIGH or LOW:HIGH:NUMBER like 0.01:100:25, 1e-9 to 1e9 Hz, LOW below HIGH, NUMBER 2 to 1000" sweep dough --frequency 5:1
refuses 2 "knead sweep: --frequency 1:2:3x: expected LOW:HIGH or LOW:HIGH:NUMBER like 0.01:100:25, 1e-9 to 1e9 Hz, LOW below HIGH, NUMBER 2 to 1000" sweep dough --frequency 1:2:3x
refuses 2 "knead sweep: --lattice: expected --amplitude, e.g. --amplitude 0.1%" sweep dough --lattice 2x2x2
knead sweep jelly --frequency 0.1:1:2 --amplitude 0.1% --lattice 1x1x1 --plate slide >out || fail "sweep of a lattice: exit $?"
awk '/^lattice/ { n = 1 } /^ *[0-9]/ { g[n + 0, $1] = $2; l[n + 0, $1] = $3 }
    END { for (f in g) { split(f, k, SUBSEP); a = g[1, k[2]] / g[0, k[2]] - 1; b = l[1, k[2]] / l[0, k[2]] - 1
        if (a * a > 1e-4 || b * b > 1e-4) exit 1 } }' out || fail "a lattice under small swings differs from its element: $(cat out)"
knead relax dough --strain 2% --ramp 5%/s --hold 5 --lattice 2x2x2 --plate slide >out || fail "relax on a lattice: exit $?"
near "$(awk '$1 == "lattice" { print $3 }' out)" "$(awk '$1 == "element" { print $3 }' out)" 0.06 || fail "lattice: $(cat out)"

begun=yes refuses 2 "knead relax: --lattice: its cells turn inside out at a strain of 0.738, expected a smaller strain or gas (--set object.pressure=cells)" relax jelly --lattice 2x2x2 --strain 80% --ramp 20%/s --hold 1
refuses 2 "knead creep: --table and --plate belong to --lattice, expected it too" creep dough --table stick

# Texture: a spring returns all energy, clay none, dough a little.
says() { grep -q "^${1/ / *}" out || fail "$2: not $1: $(cat out)"; }
knead tpa s --param s1='10 kPa' --constant-area >out || fail "tpa of a spring"
for line in "hardness 0.5 N" "cohesiveness 1.0000" "springiness 1.0000" "resilience 1.0000" "adhesiveness 0 N mm" "gumminess 0.5 N" "chewiness 0.5 N"; do says "$line" spring; done
knead tpa clay --png tpa.png --csv tpa.csv >out || fail "tpa of clay"
# 15 kPa s at 0.1 /s, on 1 cm^2 that has become 2 cm^2
for line in "cohesiveness 0.0000" "springiness 0.0000" "resilience 0.0000" "hardness 0.3 N"; do says "$line" clay; done
knead tpa dough --strain 50% --speed 1mm/s --wait 5 >out || fail "tpa of dough"
awk '/^cohesiveness/ { c = $2 + 0 } /^springiness/ { s = $2 + 0 } END { exit !(c > 0.1 && c < 0.3 && s > 0.1 && s < 0.2) }' out || fail "dough: $(cat out)"
knead tpa dough --adhesion 20kPa >out && awk '/^adhesiveness/ { exit !($2 > 0.5) }' out || fail "a plate that pulls: $(cat out)"
knead tpa dough --lattice 1x1x1 >out && [ "$(grep -c ^hardness out)" = 2 ] || fail "tpa of a lattice: $(cat out)"
[ "$(head -n 1 tpa.csv)" = bite,time_s,plate_m,strain,force_n,stress_pa ] || fail "columns of tpa"
exit $failed
