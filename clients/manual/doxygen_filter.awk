# Turn the comments of a public header into Doxygen's. The first comment is the file's, a comment on lines of its own belongs to what
# follows, a comment behind code to that code. Lines indented by four blanks or more are equations and drawings, shown as they are.
function prose(text) { gsub(/[\\@<>#%&|*]/, "\\\\&", text); return text }
function drawing(begins) {
    if (begins != drawn) print begins ? "@verbatim" : "@endverbatim"
    drawn = begins
}
/^ *\/\// {
    match($0, /^ *\/\/ ?/)
    text = substr($0, RLENGTH + 1)
    if (!inside++) print "/**" (headed++ ? "" : " @file")
    if (text == "") { blank = blank "\n"; next }
    if (text !~ /^    /) drawing(0)
    printf "%s", blank
    blank = ""
    if (text ~ /^    /) drawing(1)
    print drawn ? text : prose(text)
    next
}
inside { drawing(0); print "*/"; inside = 0; blank = "" }
match($0, /[;,{(0-9A-Za-z_)] +\/\/ /) { $0 = substr($0, 1, RLENGTH + RSTART - 4) "///< " prose(substr($0, RSTART + RLENGTH)) }
{ print }
