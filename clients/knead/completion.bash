# Completion of knead, kneadd and knead-simdev in bash, and in zsh through its bashcompinit. The options are read from
# --help when Tab is pressed, so there is no second list that could become out of date.
#
#     source <(knead completion)     for this shell; `cmake --install` puts this file where bash-completion finds it
#
# Subcommands are read from `knead --help`. Options are read from the lines of a help text that begin with an option. The
# values of an option are read from a word or a list "a|b|c" after the option, or from a list like "blend, secant or
# tangent" at the beginning of its explanation. All other arguments are completed as file names.

# Read a help text from stdin. Print a line "--option value value ..." for each option, and a line with one word for each
# subcommand or other word without a dash.
_knead_parse() {
    awk '
    function options(text, values) {
        while (match(text, /--[a-z][a-z0-9-]*/)) {
            print substr(text, RSTART, RLENGTH) values
            text = substr(text, RSTART + RLENGTH)
        }
    }
    function choices(text,    i, n, item, found) { # "a|b|c" after an option
        if (!match(text, /^[a-zA-Z0-9_]+(\|[a-zA-Z0-9_.]+)+/)) return ""
        n = split(substr(text, RSTART, RLENGTH), item, "|")
        for (i = 1; i <= n; i++) if (item[i] ~ /^[a-z0-9_]+$/) found = found " " item[i]
        return found
    }
    function listed(text,    i, n, item, found, count) { # a list like "a, b (why), c: what it is, or d"
        gsub(/ *\([^)]*\)?/, "", text)
        gsub(/: [^,;]*/, "", text)
        sub(/;$/, "", text) # the list continues in the next line
        gsub(/; |, or | or /, ", ", text)
        n = split(text, item, ", ")
        for (i = 1; i <= n && item[i] ~ /^[a-z0-9][a-z0-9_-]*$/; i++) { found = found " " item[i]; count++ }
        return count > 1 ? found : ""
    }
    /^usage:/ { usage = 1 }
    usage && NF == 0 { usage = 0 }
    usage {
        commands = commands || / COMMAND \[/
        if (match($0, / \[[a-z]+\|[a-z|]+\]/)) { # a list like "[bash|zsh]" that belongs to no option
            n = split(substr($0, RSTART + 2, RLENGTH - 3), item, "|")
            for (i = 1; i <= n; i++) print item[i]
        }
        sub(/^usage:/, "")
        if ($1 == "knead" && $3 ~ /^[a-z]+$/) print $3
        next
    }
    /^ +--?[a-z]/ {
        text = $0
        sub(/^ +/, "", text)
        at = match(text, /   */)
        left = at ? substr(text, 1, at - 1) : text
        right = at ? substr(text, at + RLENGTH) : ""
        values = ""
        if (match(left, / [a-zA-Z0-9_]+\|/)) values = choices(substr(left, RSTART + 1))
        else if (left ~ /^--[a-z-]+ [a-z]+$/) values = substr(left, index(left, " ")) # a line per value
        else if (left ~ / [A-Z]+$/ && left !~ /URL|FILE|DIR|PATH|TIME/) values = listed(right)
        options(left, values)
        next
    }
    commands && /^  [a-z]+ / { print $1 }'
}

_knead() {
    local program=${COMP_WORDS[0]} word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} parsed line words='' known
    local IFS=$'\n' # zsh has no mapfile
    COMPREPLY=()
    if [ "$word" = = ]; then word=; elif [ "$before" = = ]; then before=${COMP_WORDS[COMP_CWORD - 2]}; fi # --option=value
    if [ "${program##*/}" = knead ]; then
        known=$("$program" --help 2>/dev/null | sed -n 's/^  \([a-z]*\) .*/\1/p')
        if [ "${COMP_WORDS[1]}" = help ] && [ "$COMP_CWORD" -gt 1 ]; then # knead help NAME is completed as knead NAME
            COMP_WORDS=("$program" "${COMP_WORDS[@]:2}") COMP_CWORD=$((COMP_CWORD - 1))
        fi
        if [ "$COMP_CWORD" = 1 ]; then
            COMPREPLY=($(compgen -W "$known"$'\nhelp\n--help\n--version' -- "$word"))
            return
        fi
        case $'\n'$known$'\n' in *$'\n'"${COMP_WORDS[1]}"$'\n'*) ;; *) return ;; esac # run known subcommands only
        parsed=$("$program" "${COMP_WORDS[1]}" --help 2>/dev/null | _knead_parse)
        if [ "${COMP_WORDS[1]}" = identify ] && [ "$COMP_CWORD" -gt 2 ]; then # each command of identify has its own --help
            case $'\n'$parsed$'\n' in
            *$'\n'"${COMP_WORDS[2]}"$'\n'*) parsed=$("$program" identify "${COMP_WORDS[2]}" --help 2>/dev/null | _knead_parse) ;;
            esac
        fi
    else
        parsed=$("$program" --help 2>/dev/null | _knead_parse)
    fi
    if [ "$before" = --set ] || [ "$before" = set ]; then
        [ "${program##*/}" = knead ] || program=knead
        compopt -o nospace 2>/dev/null
        words=$("$program" check --keys 2>/dev/null | sed -n 's/^\([a-z0-9_]*\.[a-z0-9_.]*\) .*/\1=/p')
        COMPREPLY=($(compgen -W "$words" -- "$word"))
        return
    fi
    case $word in
    -*)
        words=$(sed -n 's/^\(--[^ ]*\).*/\1/p' <<<"$parsed")
        COMPREPLY=($(compgen -W "$words"$'\n--help\n--version' -- "$word" | sort -u))
        return
        ;;
    esac
    case $before in --*) words=$(sed -n "s/^$before //p" <<<"$parsed" | tr ' ' '\n' | sort -u) ;; esac
    [ -n "$words" ] || words=$(grep -v '^-' <<<"$parsed" | sort -u)
    COMPREPLY=($(compgen -W "$words" -- "$word"))
    [ -n "$words" ] && [ -z "$word" ] && return
    [ ${#COMPREPLY[@]} -gt 0 ] || COMPREPLY=($(compgen -f -- "$word"))
    for line in "${COMPREPLY[@]}"; do [ ! -d "$line" ] || compopt -o filenames 2>/dev/null; done
}
complete -F _knead knead kneadd knead-simdev
