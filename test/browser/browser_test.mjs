// Opens every page of the console in Chromium against a selfcald with simulated
// data, looks that it shows what it should, and keeps a picture of each.
//
//   node browser_test.mjs SELFCALD SELFCAL FILL_STATE SEND_SEGMENTS WEB SCREENSHOTS
//
// WEB has the node_modules. Exit code 77: no Chromium, skipped.
import assert from 'node:assert/strict';
import { execFile, execFileSync } from 'node:child_process';
import { existsSync, mkdirSync, mkdtempSync, rmSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';
import { promisify } from 'node:util';
import { bulkTests } from './bulk_tests.mjs';
import { startDaemon, workerOf } from './daemon.mjs';
import { fleetTests } from './fleet_tests.mjs';
import { hubTests } from './hub_tests.mjs';
import { interactionTests } from './interaction_tests.mjs';
import { layoutTests } from './layout_tests.mjs';
import { kPatience, Reader, until } from './reader.mjs';

const [, , selfcald, selfcal, fillState, sendSegments, web, screenshots] = process.argv;
const kChromium = '/usr/bin/chromium';
const kSkipped = 77;
const kReconnectMs = 5000; // longer than Chromium waits before it reconnects

if (!existsSync(kChromium)) {
  console.log(`skipped: there is no ${kChromium} (Debian's package chromium)`);
  process.exit(kSkipped);
}
const { chromium } = createRequire(join(web, 'package.json'))('playwright-core');
const start = promisify(execFile);

const tests = {
  async 'rigs are listed, filtered, sorted and paged by their address'(r) {
    await r.open('/?page_size=50', 'Rigs');
    await r.page.locator('tbody tr').first().waitFor();
    assert.equal(await r.page.locator('tbody tr').count(), 50);
    await r.picture('rigs');
    await r.page.getByRole('link', { name: 'Next rigs' }).click();
    await r.page.getByRole('link', { name: 'First page' }).waitFor();
    await r.sees('phone-070');
    await r.page.getByLabel('Filter').fill('tab');
    await r.rows((names) => names.length === 1 && names[0] === 'tablet');
    assert.match(r.page.url(), /filter=tab/);
    await r.page.getByLabel('Filter').fill('');
    await r.page.getByRole('link', { name: 'Last seen' }).click();
    await r.page.locator('th[aria-sort=ascending]', { hasText: 'Last seen' }).waitFor();
    await r.page.getByRole('link', { name: 'Last seen' }).click();
    await r.rows((names) => names[0] === 'tablet');
    assert.match(r.page.url(), /order_by=last_seen\+desc/);
    await r.page.reload();
    await r.rows((names) => names[0] === 'tablet');
  },

  async 'a filter that nothing passes says what to do'(r) {
    await r.shows('/?filter=nothing', 'Rigs', ['Clear the filter'], 'rigs-none');
  },

  async 'a rig tells how well it is known'(r) {
    await r.shows('/rigs/tablet', 'tablet', ['Uncertainty by group', 'focal length of camera 0, x']);
    await r.page.locator('.uplot canvas').first().waitFor();
    await r.picture('rig');
    await r.detail('rig');
  },

  async 'a rig without segments says what to do'(r) {
    const rig = '/rigs/phone-001';
    await r.shows(rig, 'phone-001', ['No segment is scored yet', 'none has arrived yet'], 'rig-idle');
    await r.shows(rig + '/segments', 'Segments of phone-001', ['No segment has arrived yet']);
    await r.shows(rig + '/recalibrations', 'Runs of phone-001', ['There are no runs yet'], 'runs-none');
  },

  async 'segments are filtered and sorted by their address'(r) {
    await r.shows('/rigs/tablet/segments', 'Segments of tablet', ['walk~0'], 'segments');
    const expected = async (filter, order) => {
      const query = new URLSearchParams({ filter, order_by: order });
      const { segments } = await r.api('rigs/tablet/segments?' + query);
      return segments.map((s) => s.name.slice(s.name.lastIndexOf('/') + 1)).join();
    };
    const filter = 'in_table = imu AND landmarks >= 1';
    await r.page.getByLabel('Filter').fill(filter);
    await r.page.keyboard.press('Enter');
    const kept = await expected(filter, '');
    const all = await expected('', '');
    assert.ok(kept.length > 0 && kept.length < all.length, kept);
    await r.rows((names) => names.join() === kept);
    await r.page.getByLabel('Scores of').selectOption('camera');
    await r.page.getByRole('link', { name: 'Gain [nat]' }).click();
    const sorted = await expected(filter, 'gain.camera desc');
    await r.rows((names) => names.join() === sorted);
    await r.page.reload();
    await r.rows((names) => names.join() === sorted);
    assert.equal(await r.page.getByLabel('Filter').inputValue(), filter);
    await r.page.locator('th[aria-sort=descending]', { hasText: 'Gain' }).waitFor();
    // A list sorted by the score of a group is then sorted by that of the other.
    await r.page.getByLabel('Scores of').selectOption('imu');
    const other = await expected(filter, 'gain.imu desc');
    await r.rows((names) => names.join() === other);
    await r.page.getByText('Filter syntax').click();
    await r.picture('segments-filtered');
    await r.page.getByRole('link', { name: 'state = UNUSABLE' }).click();
    await r.sees('No segment matches');
    await r.page.getByLabel('Filter').fill('');
    await r.rows((names) => names.length > kept.split(',').length);
  },

  async 'a filter that cannot be read says why beside its field'(r) {
    await r.open('/rigs/tablet/segments', 'Segments of tablet');
    await r.sees('walk~0');
    r.expectProblems = true;
    await r.page.getByLabel('Filter').fill('colour = 1');
    await r.page.getByRole('button', { name: 'Show' }).click();
    await r.page.getByRole('alert').getByText("'colour' is not a field").waitFor();
    assert.equal(await r.page.getByLabel('Filter').getAttribute('aria-invalid'), 'true');
    await r.picture('segments-mistake');
    r.expectProblems = false;
    await r.page.getByLabel('Filter').fill('landmarks >= 1');
    await r.page.keyboard.press('Enter');
    await r.sees('walk~0');
    assert.equal(await r.page.getByRole('alert').textContent(), '');
  },

  async 'a segment shows its motion and why it is kept'(r) {
    const { tables } = await r.api('rigs/tablet/tables');
    const { segment } = tables[0].entries[0];
    await r.page.goto(`${r.base}/${segment}`);
    await r.sees('kept: rank 1 of');
    await r.page.locator('.uplot canvas').nth(1).waitFor();
    const scrubber = r.page.getByLabel(/^Time:/);
    const before = await r.page.locator('circle.now').getAttribute('cx');
    await scrubber.focus();
    await r.page.keyboard.press('End');
    await r.sees('keyframe 20 of 20');
    assert.notEqual(await r.page.locator('circle.now').getAttribute('cx'), before);
    await r.page.getByText('Information of this segment alone about each parameter').click();
    await r.page.getByRole('row', { name: /focal length of camera 0, x \[px\]/ }).waitFor();
    // Residuals depend on the time and on the version.
    await r.sees(/Camera 0: .* px root mean square over the/);
    await r.sees('At version 1,');
    assert.ok((await r.page.locator('g.observation line').count()) > 0);
    await r.picture('segment');
    const { version } = await r.api('rigs/tablet/calibrations/active');
    await r.page.getByLabel('Residuals at').selectOption(version);
    await r.sees(/^At version [2-9],/);
    await r.page.getByLabel('IMU residuals between keyframes').selectOption('0');
    await r.page.getByRole('slider', { name: /between keyframes: rotation/ }).waitFor();
    await r.page.setViewportSize({ width: 1000, height: 800 });
    await r.page.waitForTimeout(300);
    await r.page.setViewportSize({ width: 1200, height: 800 });
    await r.sees('keyframe 20 of 20');
    const plot = r.page.getByRole('slider', { name: /^Reprojection residuals/ });
    await plot.scrollIntoViewIfNeeded();
    await plot.hover();
    await r.sees(/keyframe ([2-9]|1\d) of 20/);
    // All times are since the first keyframe, before which there are readings.
    await plot.focus();
    await r.page.keyboard.press('Home');
    await r.sees(/^Time: -?0\.00\d s, keyframe 1 of 20/);
    await r.page.getByRole('heading', { name: 'Motion' }).scrollIntoViewIfNeeded();
    await r.page.mouse.wheel(0, 300);
    await r.page.waitForTimeout(300);
    await r.detail('segment');
  },

  async 'the readings and residuals of a second IMU are shown'(r) {
    await r.page.goto(`${r.base}/rigs/pair/segments/walk~0`);
    await r.sees(/^Second IMU: rotation/);
    const plot = r.page.getByRole('slider', { name: /^Angular rates/ });
    const readings = () => plot.getAttribute('aria-valuetext');
    const first = await readings();
    await r.page.getByLabel(/^IMU(?! residuals)/).selectOption('second');
    await until('the other readings', async () => (await readings()) !== first);
    await r.picture('segment-second-imu');
    // The cursor of a plot moves the time, whichever IMU is shown.
    await plot.focus();
    await r.page.keyboard.press('End');
    await r.sees('keyframe 20 of 20');
  },

  async 'a session shows its path, coloured by the entropy of its segments'(r) {
    await r.shows('/rigs/tablet/sessions', 'Sessions of tablet', ['walk'], 'sessions');
    await r.page.getByRole('link', { name: 'walk', exact: true }).click();
    await r.heading('Session walk');
    await r.sees('most informative first');
    const { segments } = await r.api('rigs/tablet/sessions/walk/trajectory?page_size=100');
    const kept = segments.filter((s) => s.tables.length > 0);
    assert.ok(kept.length > 0 && kept.length < segments.length, 'all or none are kept');
    assert.equal(await r.page.locator('circle.kept').count(), kept.length);
    assert.equal(await r.page.locator('tbody tr').count(), kept.length);
    // Each segment has its colour: the legend counts them.
    const legend = await r.page.locator('.legend li').allTextContents();
    const counts = legend.map((text) => Number(/: (\d+)/.exec(text)[1]));
    assert.equal(counts.reduce((sum, n) => sum + n, 0), segments.length);
    await r.picture('session');
    await r.detail('session');
    const from = await r.page.locator('path.strand').first().getAttribute('d');
    await r.page.getByRole('button', { name: 'From above' }).click();
    await r.page.waitForFunction(
      (d) => document.querySelector('path.strand').getAttribute('d') !== d, from);
    const own = () => r.page.locator('circle.kept.own').count();
    const before = await r.page.locator('thead').textContent();
    await r.page.getByRole('combobox').selectOption({ index: 1 });
    assert.notEqual(await r.page.locator('thead').textContent(), before);
    assert.ok((await own()) > 0);
    // A point on the path links to its segment.
    const picture = r.page.locator('.orbit');
    await picture.hover();
    await r.sees('click to open it');
    await picture.click();
    await r.page.getByRole('heading', { level: 1, name: /^Segment walk~/ }).waitFor();
  },

  async 'a segment whose data is gone says so'(r) {
    const { segments } = await r.api('rigs/tablet/segments?page_size=100&view=BASIC');
    const gone = segments.find((s) => !s.hasData);
    assert.ok(gone, 'every segment has its data');
    await r.page.goto(`${r.base}/${gone.name}`);
    await r.sees('Its data was dropped');
    await r.sees(/not kept|kept until/);
    await r.picture('segment-dropped');
    // An entry that a later segment replaced names that segment.
    for (const { name } of segments) {
      const { exclusions } = await r.api(name);
      const replaced = exclusions.find((exclusion) => exclusion.cause === 'REPLACED');
      if (!replaced) continue;
      await r.page.goto(`${r.base}/${name}`);
      await r.sees('kept until');
      const rival = r.page.getByRole('cell', { name: /kept until/ }).first().getByRole('link');
      assert.equal(await rival.getAttribute('href'), '/' + replaced.rival);
      await r.picture('segment-replaced');
      return;
    }
    assert.fail('no segment was replaced in a table');
  },

  async 'the history compares versions and shows their origin'(r) {
    await r.open('/rigs/tablet/calibrations', 'Calibrations of tablet');
    await r.page.locator('.uplot canvas').waitFor();
    await r.sees('Comparison of two versions');
    await r.page.getByLabel('From version').selectOption('1');
    await r.sees('Version 1');
    assert.match(r.page.url(), /a=1/);
    await r.picture('calibrations');
    await r.shows('/rigs/tablet/calibrations/2', 'Calibrations of tablet',
      ['Validation'], 'calibration');
  },

  async 'runs are listed and explained'(r) {
    await r.shows('/rigs/tablet/recalibrations', 'Runs of tablet', ['tables full'], 'runs');
    await r.shows('/rigs/tablet/recalibrations/1', 'Run 1 of tablet',
      ['Solver report'], 'run');
  },

  async 'mistakes in an address are explained'(r) {
    r.expectProblems = true;
    await r.shows('/rigs/none', 'none', ['rig none does not exist'], 'rig-unknown');
    assert.equal(await r.page.getByRole('alert').count(), 1);
    await r.open('/nothing', 'There is no such page');
    await r.open('/rigs/tablet/segments/none~1', 'Segment none~1');
    await r.page.getByRole('alert').first().waitFor();
    r.expectProblems = false;
  },

  async 'a version is activated by keyboard, and other pages see it'(r, other) {
    await other.shows('/rigs/tablet/events', 'Events of tablet', ['live']);
    await r.open('/rigs/tablet/calibrations', 'Calibrations of tablet');
    const button = r.page.getByRole('button', { name: /Roll back|Activate/ }).last();
    await button.focus();
    await r.page.keyboard.press('Enter');
    await r.page.getByRole('dialog').waitFor();
    await r.picture('activate');
    await r.page.getByLabel('Reason').fill('the browser test asked for it');
    await r.page.keyboard.press('Tab');
    await r.page.keyboard.press('Tab');
    await r.page.keyboard.press('Enter');
    await r.page.getByRole('dialog').waitFor({ state: 'detached', timeout: kPatience });
    await other.sees('the browser test asked for it');
    await other.picture('events');
  },

  async 'a rig is labelled, found by its label, and deleted'(r) {
    await r.open('/rigs/phone-049', 'phone-049');
    await r.page.getByRole('button', { name: 'Edit labels' }).click();
    await r.page.getByRole('dialog').getByRole('textbox').fill('site = lab\nowner = me');
    await r.picture('labels');
    await r.page.getByRole('button', { name: 'Save' }).click();
    await r.sees('owner = me');
    await r.open('/', 'Rigs');
    await r.page.getByLabel('Filter').fill('labels.site = lab');
    await r.rows((names) => names.length === 1 && names[0] === 'phone-049');
    await r.open('/rigs/phone-049', 'phone-049');
    await r.page.getByRole('button', { name: 'Delete rig' }).click();
    await r.page.getByLabel('Reason').fill('it was lost');
    await r.page.getByRole('button', { name: 'Delete', exact: true }).click();
    await r.heading('Rigs');
    await r.shows('/events', 'Events', ['it was lost']);
  },

  async 'a segment that a calibration was computed from is not deleted'(r) {
    const { calibrations } = await r.api('rigs/tablet/calibrations');
    const [name] = calibrations.find((c) => c.provenance).provenance.segments;
    await r.open('/' + name, 'Segment ' + decodeURIComponent(name.slice(name.lastIndexOf('/') + 1)));
    r.expectProblems = true;
    await r.page.getByRole('button', { name: 'Delete', exact: true }).click();
    const dialog = r.page.getByRole('dialog');
    await dialog.getByLabel('Reason').fill('a try');
    await dialog.getByRole('button', { name: 'Delete', exact: true }).click();
    await dialog.getByRole('alert').waitFor();
    assert.match(await dialog.getByRole('alert').textContent(), /version \d+ was computed from/);
    await dialog.getByRole('button', { name: 'Cancel' }).click();
    r.expectProblems = false;
  },

  async 'events of all rigs are listed'(r) {
    await r.shows('/events', 'Events', ['rig created'], 'all-events');
  },

  async 'a parameter of all rigs is compared'(r) {
    await r.shows('/parameters', 'Parameters', ['phone-'], 'parameters');
    await r.page.locator('.uplot canvas').first().waitFor();
    await r.page.getByRole('searchbox', { name: 'Rigs' }).fill('name = tablet');
    await r.page.getByRole('link', { name: 'tablet', exact: true }).waitFor();
    assert.match(r.page.url(), /filter=name/);
    assert.equal(await r.page.getByRole('link', { name: /^phone-/ }).count(), 0);
    await r.shows('/parameters?component=cam9.focal.x', 'Parameters', ['No active version']);
    r.expectProblems = true;
    await r.shows('/parameters?filter=nonsense+%3D+1', 'Parameters', ['is not a condition']);
    r.expectProblems = false;
  },

  async 'a daemon without a hub says what cohorts and instructions are'(r) {
    await r.shows('/cohorts', 'Cohorts', ['cohort-label'], 'cohorts-none');
    await r.shows('/rigs/tablet/instructions', 'Instructions for tablet',
      ['There are no instructions'], 'instructions-none');
  },

  async 'the coach follows the segments as they come'(r, other, daemon, send) {
    await r.open('/rigs/headset', 'headset');
    await r.page.getByRole('link', { name: 'Coach' }).click();
    await r.heading('Coach of headset');
    await r.sees('and 0 segments in the tables');
    const expected = () => r.page.locator('.advice').textContent();
    const before = await expected();
    assert.match(before, /\d % smaller/);
    assert.equal(await r.page.locator('.advice').getAttribute('aria-live'), 'polite');
    assert.equal(await r.page.locator('tbody tr').count(), 14);
    // The plan is that of the command line.
    const { lessons } = await r.api('rigs/headset:adviseMotion');
    assert.ok(lessons.length > 0);
    await r.sees('To be recorded');
    assert.equal(await r.page.locator('.plan > li > strong').count(), lessons.length);
    for (const lesson of lessons) await r.sees(lesson.instruction);
    await r.picture('coach');
    await r.detail('coach');
    await send([daemon.address, 'headset', 'carried', '6']);
    await r.sees(/and [1-9] segments? in the tables/);
    assert.notEqual(await expected(), before);
    await r.shows('/rigs/tablet/coach', 'Coach of tablet', ['Least certain directions']);
  },

  async 'a run is drawn while it computes'(r, other, daemon) {
    const started = start(selfcal, ['--target', daemon.address, 'recalibrate', 'tablet', '--force', '--no-wait']);
    const worker = await until('a worker', () => workerOf(daemon.pid));
    process.kill(worker, 'SIGSTOP');
    try {
      await started;
      const [{ name }] = (await r.api('rigs/tablet/recalibrations')).recalibrations;
      const number = name.slice(name.lastIndexOf('/') + 1);
      const heading = `Run ${number} of tablet`;
      await r.open('/' + name, heading);
      // Continues it in small steps, until the page shows two iterations.
      await until('the second iteration', async () => {
        process.kill(worker, 'SIGCONT');
        await sleep(10);
        process.kill(worker, 'SIGSTOP');
        await sleep(50);
        return r.page.getByText(/^Iteration ([2-9]|\d\d)/).count();
      });
      // A page that is opened now shows it from the beginning.
      await other.shows('/' + name, heading, ['Iteration ', 'focal length of camera 0, x']);
      const line = other.page.locator('.course .path').first();
      const points = await line.getAttribute('points');
      assert.ok(points.split(' ').length >= 3, points);
      assert.equal(await line.evaluate((e) => getComputedStyle(e).fill), 'none');
      await other.picture('run-live');
      await other.detail('run');
      // An error that ends a stream is shown.
      const event = 'event: error\ndata: {"code": "DATA_LOSS", "message": "the run is damaged"}\n\n';
      const isWatch = (url) => url.pathname.endsWith(':watch');
      await other.page.route(isWatch, (route) =>
        route.fulfill({ contentType: 'text/event-stream', body: event }));
      await other.shows('/' + name, heading, ['the run is damaged']);
      await other.page.unroute(isWatch);
    } finally {
      process.kill(worker, 'SIGCONT');
    }
    // The drawing stays when the run has ended, and its stream is not opened again.
    let opened = 0;
    r.page.on('request', (request) => {
      if (/recalibrations\/\d+:watch$/.test(request.url())) ++opened;
    });
    await r.sees('Solver report');
    await sleep(kReconnectMs);
    assert.equal(opened, 0, 'the stream of a run that has ended is opened again');
    await r.sees('Over the iterations');
    await r.picture('run-ended');
  },
};

const folder = mkdtempSync(join(tmpdir(), 'selfcal-browser-'));
mkdirSync(screenshots, { recursive: true });
let daemon;
let browser;
try {
  execFileSync(fillState, [join(folder, 'state')], { stdio: 'inherit' });
  daemon = startDaemon(selfcald, join(folder, 'state'));
  const base = await daemon.url;
  browser = await chromium.launchPersistentContext(join(folder, 'profile'), {
    executablePath: kChromium,
    headless: true,
    viewport: { width: 1200, height: 800 },
    args: ['--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run',
      '--disable-background-networking', '--disable-component-update',
      '--disable-sync'],
  });
  browser.setDefaultTimeout(kPatience);
  const reader = new Reader(await browser.newPage(), base, screenshots);
  const other = new Reader(await browser.newPage(), base, screenshots);
  const send = (args) => start(sendSegments, args);
  const all = {
    ...interactionTests, ...tests, ...fleetTests, ...bulkTests, ...hubTests, ...layoutTests,
  };
  for (const [name, run] of Object.entries(all)) {
    console.log(name);
    await run(reader, other, daemon, send);
    assert.deepEqual([...reader.problems, ...other.problems], [], name);
  }
  console.log('a daemon that has stopped');
  reader.expectProblems = other.expectProblems = true;
  await reader.shows('/rigs/tablet', 'tablet', ['Uncertainty by group']);
  await daemon.stop();
  await reader.page.getByText('not live').waitFor();
  await reader.page.getByRole('link', { name: 'Segments', exact: true }).click();
  await reader.sees('The daemon does not answer');
  await reader.picture('stopped');
  console.log(`every page is as it should be; pictures are in ${screenshots}`);
} finally {
  await browser?.close();
  await daemon?.stop();
  rmSync(folder, { recursive: true, force: true });
}
