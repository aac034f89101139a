"""kinoise as a peer of ../shared/peers/bench.py:
  bench.py WORK SEQ --extra 'ours=python3 tests/tools/peer.py BINARY --method paper'
It is called with SEQ STRIDE FRAMES THREADS TRAJ appended and prints one JSON line. Times are those of mapping, decoding
included, without colour, by frame; that is what the peers count. The stage `whole` is the process from start to end, with
the check of the sequence, the camera's tables and the pages that are written. CPU time stays honest on a busy machine."""
import json, os, resource, shutil, subprocess, sys, tempfile, time

*command, seq, stride, frames, threads, traj = sys.argv[1:]
binary, *options = command
with tempfile.TemporaryDirectory() as out:
    begin = time.perf_counter()
    run = subprocess.run([binary, 'map', seq, '-o', out, '--stride', stride, '--frames', frames, '--threads', threads,
                          '--no-colour', '--json', *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    whole = time.perf_counter() - begin
    if run.returncode:
        sys.exit(run.stderr)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    stats = json.loads(run.stdout)
    n = stats['frames']
    if traj != os.devnull:
        shutil.copy(os.path.join(out, 'trajectory.txt'), traj)
each = lambda seconds: [1e3 * seconds / n] * n
cpu = {name: [ms] * 2 for name, ms in stats['ms'].items() if name != 'total'}
stages = dict(cpu, whole=each(whole)[:2])
cpu['whole'] = each(used.ru_utime + used.ru_stime)[:2]
print(json.dumps({'peer': 'kinoise', 'total': each(stats['seconds']), 'cpu': each(stats['cpu_seconds']), 'stages': stages,
                  'stages_cpu': cpu, 'iters': [stats['iterations']], 'rss': stats['peak_rss_mb'], 'rss_base': 0, 'identity': 0}))
