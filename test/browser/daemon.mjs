// A selfcald for the test of the pages.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { readdirSync, readFileSync } from 'node:fs';
import { join } from 'node:path';

// The daemon, once it says where its console is.
export function startDaemon(selfcald, state) {
  const address = 'unix:' + join(state, 's');
  const daemon = spawn(
    selfcald,
    ['--state-dir', state, '--listen', address, '--run-priority', 'low',
      '--console', '127.0.0.1:0', '--console-role', 'administer'],
    { stdio: ['ignore', 'ignore', 'pipe'] },
  );
  const url = new Promise((resolve, reject) => {
    let log = '';
    daemon.stderr.on('data', (bytes) => {
      log += bytes;
      const found = /console: (http:\S+)/.exec(log);
      if (found && log.includes('ready')) resolve(found[1]);
    });
    daemon.on('exit', (code) => reject(new Error(`selfcald ended (${code}):\n${log}`)));
  });
  const stop = async () => {
    if (daemon.exitCode !== null) return;
    const ended = new Promise((resolve) => daemon.on('exit', resolve));
    daemon.kill('SIGTERM');
    assert.equal(await ended, 0, 'selfcald did not stop in order');
  };
  return { url, stop, address, pid: daemon.pid };
}

// The process in which the daemon calibrates; 0 where there is none.
export function workerOf(pid) {
  const children = readdirSync(`/proc/${pid}/task`).map((task) => {
    try {
      return readFileSync(`/proc/${pid}/task/${task}/children`, 'utf8');
    } catch {
      return ''; // the thread has ended
    }
  });
  return Number(children.join('').trim().split(' ')[0]);
}
