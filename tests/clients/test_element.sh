#!/usr/bin/env bash
# knead element: the paper's verdicts on its figure 2, the mechanics beside them, and one line for a wrong expression.
set -u
source "$KN_SOURCE/tests/clients/refuses.sh"
program="knead element"

# says EXPRESSION LINE...: check that every line occurs in the output for the expression.
says() {
    local expression=$1
    shift
    knead element "$expression" >out 2>err || fail "$expression: exit $?: $(cat err)"
    for line; do grep -qF -- "$line" out || fail "$expression: the output lacks: $line"; done
}
# core.element has the properties of all entries
knead element --catalogue >catalogue || fail "--catalogue: exit $?"
[ "$(awk '/^\(/ && $6 == "yes" { printf "%s", substr($1, 2, 1) }' catalogue)" = dfgk ] || fail "all three properties: $(cat catalogue)"
grep -q "^All three properties with the fewest parts: (d) and (f)\." catalogue || fail "(d) and (f) are not named as the elements with the fewest parts"

says 'd-(d|s)' 'element     (s|d)-d, jeffreys: 1 spring, 2 dampers; figure 2 (d)' \
    's|d          no, in parallel, one part that recovers is enough (Table 1b): s' \
    'every part of the series has a damper: s|d, d' 'has all three properties of a rheological object' \
    'impedance   Z(p) = (b1 p + b2 p^2) / (1 + a1 p)' 'long term   fluid' 'instant     dashpot' \
    'parameters  3 of 3' 'as Maxwell units side by side (s-d)|d' "in the paper's figure 2: d f;"
says zener 'long term   solid' 'instant     spring' 'class       standard linear solid' \
    'the rule says "decreases" here and "remains" for (s|d)-s, which is the same one-port'
says 's-(s|d)' 'the rule says "remains" here and "decreases" for (s-d)|s, which is the same one-port'
says '((s-d)|d)-d' 'parameters  3 of 4 can be identified: the element has more parts than its response shows' 'class       Jeffreys'
says s 'not rheological: no residual deformation, vibration remains' 'swings for ever'

refuses 2 "EXPR:1:3: unknown element 'x', expected s, d, a name like voigt, or (" 's-x'
refuses 2 "EXPR:1:1: ends here, expected s, d, a name like voigt, or (" ''
refuses 2 "knead element: expected one expression like '(s|d)-d', or --catalogue; see --help"
refuses 2 "knead element: expected one expression like '(s|d)-d', or --catalogue; see --help" --catalogue s
refuses 2 "knead element: --wood: unknown option; --help lists them" --wood
exit $failed
