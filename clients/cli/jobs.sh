# A list of jobs is a shell script: assignments by cli/jobs.c, this text, and a line `job RESULT WORD...` for each job.
#
#     sh jobs here|parallel|hosts|slurm     play all jobs by this engine, in the folder of the results
#     sh jobs one RESULT SUM                play one job; SUM: checksum of this program
#     sh jobs task K                        play the jobs of task K of an array
#
# A job with a result is never played again.
number=-1 only= task= tasks=${jobs:-1000} # Slurm allows 1001 tasks, unless the site has changed its MaxArraySize
job() {
    number=$(((number + 1) % tasks))
    [ "${only:-$1}" = "$1" ] && [ ${task:-$number} = $number ] && [ ! -e "$folder/$1" ] || return 0
    path=$folder/$1
    shift
    "$knead" "$command" --job "$path" "$@" </dev/null || exit
}
# watch COMMAND...: run an engine. A SIGTERM to this shell is one to the engine.
watch() {
    "$@" &
    trap "kill $!" TERM
    while kill -0 $! 2>/dev/null; do wait $!; done
}
by_parallel() { watch parallel --plain --will-cite --halt now,fail=1 ${jobs:+--jobs=$jobs} -a results "$@"; }
case $1 in
one) only=$2 sum=$3 ;;
task) task=$2 ;;
parallel)
    by_parallel "exec sh jobs one {}"
    exit
    ;;
hosts)
    # Send the files that links lead to. The jobs of the host `:` begin in an empty folder below this one. The option
    # --cleanup is not sufficient: it leaves all files if a job failed or was interrupted. An unreachable host has been
    # reported already.
    IFS='
'
    export PARALLEL_RSYNC_OPTS=-rLDzR
    by_parallel --sshlogin "$hosts" --workdir $name $(sort -u sent | sed 's/^/--basefile=/') --return {} "[ -e jobs ] || cd ..; exec sh jobs one {} '$(cksum <"$knead")'"
    trap '' TERM # what has been begun is cleared away
    exec parallel --plain --will-cite --timeout 20 --nonall --sshlogin "$hosts" rm -rf $name 2>/dev/null
    ;;
slurm)
    count=$(wc -l <results)
    rm -f slurm.log
    watch sbatch --wait --requeue --array=0-$(((count < tasks ? count : tasks) - 1)) --job-name=$name --output=slurm.log \
        --open-mode=append --wrap 'exec sh jobs task $SLURM_ARRAY_TASK_ID'
    [ ! -e slurm.log ] || cat slurm.log >&2
    trap '' TERM
    exec scancel --quiet --name $name # the array outlives an sbatch that is ended
    ;;
esac
if [ -z "$hosts" ] || [ "$PARALLEL_SSHLOGIN" = : ]; then
    cd "$home" || exit
else
    folder=. knead=$(command -v knead)
    [ "$(cksum <"${knead:-/dev/null}")" = "$sum" ] ||
        { echo "knead $command: $PARALLEL_SSHLOGIN has no knead in its PATH, or another build" >&2 && exit 3; }
fi
