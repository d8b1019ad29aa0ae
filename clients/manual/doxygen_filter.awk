# Turn the comments of a public header into Doxygen's. The first comment is the file's, a comment on lines of its own belongs to what
# follows, a comment behind code to that code. Lines indented by four blanks or more are equations and drawings, shown as they are.
function prose(text) { gsub(/[\\@<>#%&|*_~`]/, "\\\\&", text); return text }
function drawing(begins) {
    if (begins != drawn) print begins ? "/// @verbatim" : "/// @endverbatim"
    drawn = begins
}
/^ *\/\// {
    match($0, /^ *\/\/ ?/)
    text = substr($0, RLENGTH + 1)
    if (!headed++) print "/// @file"
    if (text != "") drawing(text ~ /^    /)
    print "/// " (drawn ? text : prose(text))
    next
}
{ drawing(0) }
match($0, /[;,{(0-9A-Za-z_)] +\/\/ /) { $0 = substr($0, 1, RLENGTH + RSTART - 4) "///< " prose(substr($0, RSTART + RLENGTH)) }
{ print }
