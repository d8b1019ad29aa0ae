#!/usr/bin/env bash
# The Python package knead: from the build folder, and as a wheel in a fresh environment, where the same press has the bits
# of C. The hand, and reading logs, need no numpy and no library.
set -u
source "$KN_SOURCE/tests/e2e/kneadd.sh"

examples=$KN_SOURCE/clients/examples
export PYTHONPATH=$KN_BUILD/python
cc -I "$KN_BUILD/include" -o press "$examples/press.c" -L "$KN_BUILD/core" -lknead -Wl,-rpath,"$KN_BUILD/core"
./press >press.txt
python3 "$examples/press.py" | cmp - press.txt
check "press.py prints the 31 lines of press.c" [ $? = 0 ]

knead creep dough --csv curve.csv >creep.log
start_kneadd dough-small.yaml
knead probe --quiet --depth "4 mm" --hold 0.3 --record press.lcmlog >probe.log 2>&1
kill -INT "$server" && wait "$server"
python3 "$KN_SOURCE/tests/e2e/python_package.py" press.lcmlog curve.csv
check "the package does what its texts say" [ $? = 0 ]

python3 "$examples/arm.py" >again.txt
check "an arm presses dough: $(python3 "$examples/arm.py" | tee arm.txt | tail -n 1)" sh -c 'grep -q ^hash arm.txt && cmp arm.txt again.txt'
python3 "$examples/flatten.py" --states 8 --rounds 2 --threads 1 | grep -v ' s$' >one.txt
python3 "$examples/flatten.py" --states 8 --rounds 2 --threads 2 | grep -v ' s$' >two.txt
cat two.txt
check "a search finds the same plan and the same bits on one and two threads" sh -c 'grep -q "^hash" one.txt && cmp one.txt two.txt'

unset PYTHONPATH
cmake --build "$KN_BUILD" --target wheel >wheel.log 2>&1
check "the wheel is built" [ -s "$KN_BUILD"/knead-*-py3-none-linux_*.whl ] || cat wheel.log
/usr/bin/python3 -m venv --system-site-packages environment
environment/bin/pip install --quiet --no-deps --no-index "$KN_BUILD"/knead-*.whl >pip.log 2>&1 || cat pip.log
environment/bin/python "$examples/press.py" | cmp - press.txt
check "the wheel in a fresh environment has the same bits" [ $? = 0 ]
/usr/bin/python3 -m venv bare
bare/bin/pip install --quiet --no-deps --no-index "$KN_BUILD"/knead-*.whl >pip.log 2>&1 || cat pip.log
check "without numpy there is still a hand" bare/bin/python -c 'import knead; knead.Hand("finger").close()'
exit $failed
