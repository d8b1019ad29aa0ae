#!/usr/bin/env bash
# knead batch --slurm on a real Slurm: munged, slurmctld and two slurmd, each slurmd with a network, a host name and
# processes of its own. One node is killed while the array runs. The table of 2 000 runs is that of one process.
# night: a minute and more of computation, and the time until Slurm gives up a node
source "$KN_SOURCE/tests/e2e/kneadd.sh"
for program in munged slurmctld slurmd sbatch; do
    PATH=$PATH:/usr/sbin:/sbin
    command -v $program >/dev/null || { echo "skipped: no $program here (packages slurm-wlm, munge)"; exit 77; }
done
[ "$(id -u)" = 0 ] || { echo "skipped: slurmd plays jobs of root only as root"; exit 77; }

runs=2000
for ((i = 1; i <= runs; i++)); do
    materials=(dough clay "$KN_SOURCE/core/scenes/jelly.yaml" "dough --lattice 2x2x2 --hold 0.5 --rest 0.5")
    echo "creep ${materials[i % 4]} --load $((i / 4 + 1))gf"
done >list
TIMEFORMAT=%R
one=$({ time knead batch list --out one.csv >one.txt; } 2>&1)
check "one worker plays $runs runs" [ $? = 0 ] || echo "$one"

# The namespace of this test is the controller's. A bridge connects it with the nodes.
pids=()
nodes=() # for each node, its process 1; a SIGKILL to it is one to all processes of the node
in_node() { nsenter -t "${nodes[$1]}" -n -u -p -m "${@:2}"; }
trap 'kill -KILL "${nodes[@]}" "${pids[@]}" 2>/dev/null' EXIT
ip link add bridge0 type bridge && ip addr add 10.77.0.1/24 dev bridge0 && ip link set bridge0 up ||
    { echo "skipped: no bridge here"; exit 77; }
for node in 1 2; do
    unshare -n -u -p --mount-proc --fork sleep 1000 2>"unshare$node.txt" &
    parent=$!
    await eval 'nodes[node]=$(pgrep -P $parent -x sleep)'
    ip link add "veth$node" type veth peer name eth0 netns "${nodes[node]}"
    ip link set "veth$node" master bridge0 up
    in_node $node hostname "n$node"
    in_node $node sh -c "ip link set lo up && ip addr add 10.77.0.1$node/24 dev eth0 && ip link set eth0 up"
done

export SLURM_CONF=$PWD/slurm.conf
cat >slurm.conf <<CONF
ClusterName=knead
SlurmctldHost=$(hostname -s)(10.77.0.1)
SlurmUser=root
AuthInfo=socket=$PWD/munge.socket
StateSaveLocation=$PWD/state
SlurmdSpoolDir=$PWD/spool.%n
SlurmctldPidFile=$PWD/slurmctld.pid
SlurmdPidFile=$PWD/slurmd.%n.pid
SlurmctldLogFile=$PWD/slurmctld.log
SlurmdLogFile=$PWD/slurmd.%n.log
ProctrackType=proctrack/linuxproc
SlurmdTimeout=6
SchedulerParameters=batch_sched_delay=0,sched_min_interval=0
NodeName=n[1-2] NodeAddr=10.77.0.1[1-2] CPUs=1
PartitionName=all Nodes=ALL Default=YES
CONF
mkdir state
head -c 64 /dev/urandom >munge.key && chmod 600 munge.key && chmod 755 .
munged --foreground --force --key-file="$PWD/munge.key" --socket="$PWD/munge.socket" --pid-file="$PWD/munge.pid" \
    --seed-file="$PWD/munge.seed" --log-file="$PWD/munge.log" >munged.txt 2>&1 &
pids+=($!)
await [ -S munge.socket ]
slurmctld -D >slurmctld.txt 2>&1 &
pids+=($!)
for node in 1 2; do in_node $node slurmd -D >"slurmd$node.txt" 2>&1 & done
both() { [ "$(sinfo --noheader --Node --format %t | sort -u)" = idle ] && [ "$(sinfo --noheader --Node | wc -l)" = 2 ]; }
check "two nodes are idle" await both || { sinfo -N; tail -n 5 munge.log slurmctld.log slurmd*.log *.txt; exit 1; }

# 8 tasks for two processors: each costs Slurm a second.
two=$({ time knead batch list --out two.csv --slurm --jobs 8 >two.txt; } 2>&1)
check "an array of 8 tasks plays $runs runs" [ $? = 0 ] || echo "$two"
check "its table is that of one worker, byte for byte" cmp one.csv two.csv
awk "BEGIN { print \"$runs runs: one worker $one s, two nodes of Slurm $two s, speed-up\", $one / $two }"

# An array does not outlive the command that waits for it.
queued() { [ -n "$(squeue --noheader)" ]; }
knead batch list --out ended.csv --slurm --jobs 8 >/dev/null 2>&1 &
batch=$!
check "an array is in the queue" await queued
kill -TERM $batch
wait $batch
check "a batch that is ended leaves no array" await eval '! queued'
rm -r ended.csv.runs

# A node dies with all its processes when a third of the runs is done.
knead batch list --out three.csv --slurm --jobs 8 >three.txt 2>three.err &
batch=$!
third() { [ "$(ls three.csv.runs 2>/dev/null | wc -l)" -gt $((runs / 3)) ]; }
check "a third of the runs is done" await third
check "the second node is at work" [ "$(squeue --noheader --nodelist n2 --states running | wc -l)" = 1 ]
kill -KILL "${nodes[2]}"
patience=200
requeued() { task=$(squeue --noheader --array --format '%i %r' | sed -n 's/ BeginTime$//p') && [ -n "$task" ]; }
check "the controller requeues the task of the dead node" await requeued
# Slurm would begin a requeued task two minutes later.
[ -z "$task" ] || scontrol update "jobid=$task" starttime=now
wait $batch
check "the batch ends with 0" [ $? = 0 ] || cat three.err
check "its log says so, too" grep -q 'CANCELLED AT .* DUE TO NODE FAILURE\|requeue' slurmctld.log
check "the table is that of one worker, byte for byte" cmp one.csv three.csv
check "no folder of runs is left" [ -z "$(ls -d ./*.runs 2>/dev/null)" ]
[ $failed = 0 ] || tail -n 20 slurmctld.log
exit $failed
