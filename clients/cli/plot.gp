# The common look of all plots. knead's commands embed this file; bench/papers loads it. The variables
# `wide` and `high`, the size of the image in pixels, must be set before. The colours are those of Okabe and Ito, which
# colour-blind readers can distinguish. The darker colours come first. In a grey print, points and dashes distinguish
# the curves.
set encoding utf8
set terminal pngcairo noenhanced size wide,high font 'sans,11'
set border 3 lc rgb '#444444'
set tics nomirror out scale 0.6
set grid lt 1 lw 1 lc rgb '#e2e2e2'
set key Left reverse samplen 2.5 spacing 1.15
set linetype 1 lc rgb '#0072b2' lw 2 pt 7 ps 0.8
set linetype 2 lc rgb '#d55e00' lw 2 pt 5 ps 0.7
set linetype 3 lc rgb '#000000' lw 2 pt 9 ps 0.9
set linetype 4 lc rgb '#009e73' lw 2 pt 13 ps 1
set linetype 5 lc rgb '#e69f00' lw 2 pt 11 ps 0.9
set linetype 6 lc rgb '#cc79a7' lw 2 pt 6 ps 0.9
set linetype 7 lc rgb '#56b4e9' lw 2 pt 4 ps 0.8
set linetype 8 lc rgb '#777777' lw 2 pt 8 ps 0.9
set linetype cycle 8
