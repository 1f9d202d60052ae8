// Changes all rigs of a filter.
import assert from 'node:assert/strict';
import { until } from './reader.mjs';

const queryOf = (query) => new URLSearchParams(query).toString();

const kLabelled = ['phone-001', 'phone-002', 'tablet'];
const kFilter = 'labels.batch = bulk';

// Shows the rigs of the filter, and asks for a change of them.
export async function ask(r, button) {
  for (const rig of kLabelled) {
    const name = 'rigs/' + rig;
    await r.change('PATCH', name + '?updateMask=labels', { name, labels: { batch: 'bulk' } });
  }
  await r.open('/?' + queryOf({ filter: kFilter }), 'Rigs');
  await r.rows((names) => names.join() === kLabelled.join());
  await r.page.getByRole('button', { name: button }).click();
  const dialog = r.page.getByRole('dialog');
  const namesIn = (table) =>
    dialog.getByRole('region', { name: table }).locator('tbody th').allTextContents();
  // Focuses the heading when it changes, so that a screen reader reads it.
  const titled = async (name) => {
    await dialog.getByRole('heading', { name, exact: true }).waitFor();
    await until('the focus', () => r.page.evaluate(
      (title) => document.activeElement.textContent === title, name));
  };
  const close = async () => {
    await dialog.getByRole('button', { name: 'Close' }).click();
    await dialog.waitFor({ state: 'detached' });
  };
  return { dialog, namesIn, titled, close };
}

// The changes that the dialog lists, by rig.
async function changesIn(dialog) {
  const rows = dialog.getByRole('region', { name: 'Rigs to change' }).locator('tbody tr');
  return Object.fromEntries(await rows.evaluateAll((all) =>
    all.map((row) => [...row.children].slice(0, 2).map((cell) => cell.textContent))));
}

// Asks for a roll-back with these choices.
async function askRollBack(r, { since = '', again = false } = {}) {
  const asked = await ask(r, 'Roll back these rigs');
  const { dialog } = asked;
  await dialog.getByLabel(/^Only where the active version was created since/).fill(since);
  await dialog.getByLabel(/^also where a version was rolled back before/).setChecked(again);
  await dialog.getByRole('button', { name: 'Continue' }).click();
  return asked;
}

// Shows other versions of the tablet, [number, state] from the newest, which
// are an hour old, and takes the activations.
async function withVersions(r) {
  const shown = { versions: [] };
  const activated = [];
  const createTime = new Date(Date.now() - 3_600_000).toISOString();
  const path = '/api/v1/rigs/tablet/calibrations';
  const isList = (url) => url.pathname === path;
  await r.page.route(isList, (route) => {
    const calibrations = shown.versions.map(([version, state]) => ({
      name: `rigs/tablet/calibrations/${version}`, version: String(version), state, createTime,
    }));
    return route.fulfill({ json: { calibrations, nextPageToken: '' } });
  });
  const isActivation = (url) => url.pathname.startsWith(path + '/') &&
    url.pathname.endsWith(':activate');
  await r.page.route(isActivation, (route) => {
    const { pathname } = new URL(route.request().url());
    activated.push([pathname.slice(path.length + 1), route.request().postDataJSON()]);
    return route.fulfill({ json: {} });
  });
  const end = async () => {
    await r.page.unroute(isList);
    await r.page.unroute(isActivation);
  };
  return { shown, activated, end };
}

export const bulkTests = {
  async 'rigs of a filter are recalibrated, and a failure does not hold up the others'(r) {
    await r.open('/', 'Rigs');
    await r.rows((names) => names.length > 0);
    assert.equal(await r.page.getByRole('button', { name: /these rigs/ }).count(), 0);
    const { dialog, namesIn, titled, close } = await ask(r, 'Recalibrate these rigs');
    await titled('Recalibrate 3 rigs?');
    assert.deepEqual(await namesIn('Rigs to change'), kLabelled);
    await r.picture('bulk-confirm');
    await r.page.keyboard.press('Escape');
    await dialog.waitFor({ state: 'detached' });

    const before = (await r.api('rigs/tablet/recalibrations')).recalibrations.length;
    await r.page.getByRole('button', { name: 'Recalibrate these rigs' }).click();
    await dialog.getByLabel(/^also where the tables have not changed/).check();
    r.expectProblems = true;
    await dialog.getByRole('button', { name: 'Recalibrate', exact: true }).click();
    await titled('Recalibrating 3 rigs: ended');
    assert.equal(
      await dialog.getByRole('status').textContent(), 'A run was started on 1 of 3 rigs.');
    assert.deepEqual((await namesIn('Failed')).sort(), ['phone-001', 'phone-002']);
    await dialog.getByText('the tables of rig phone-001 are empty').waitFor();
    await r.picture('bulk-failed');
    await close();
    r.expectProblems = false;
    await until('the end of the run', async () => {
      const { recalibrations } = await r.api('rigs/tablet/recalibrations');
      return recalibrations.length === before + 1 && recalibrations.every((run) => run.endTime);
    });
  },

  async 'rigs of a filter are rolled back, and once alone'(r) {
    const versions = async () => (await r.api('rigs/tablet/calibrations?view=BASIC')).calibrations;
    const newest = (await versions()).find((c) =>
      ['ACTIVE', 'SUPERSEDED', 'ROLLED_BACK'].includes(c.state));
    await r.change('POST', newest.name + ':activate', { reason: 'the test begins with it' });
    const earlier = (await versions()).filter((c) => Number(c.version) < Number(newest.version));
    const before = earlier.find((c) => c.state === 'SUPERSEDED').version;

    const { dialog, namesIn, titled, close } = await askRollBack(r);
    await titled('Roll back 1 rig?');
    assert.deepEqual(await namesIn('Rigs to change'), ['tablet']);
    await dialog.getByText(`from version ${newest.version} to ${before}`).waitFor();
    assert.deepEqual(await namesIn('Left out'), ['phone-001', 'phone-002']);
    const confirm = dialog.getByRole('button', { name: 'Roll back', exact: true });
    assert.ok(await confirm.isDisabled(), 'no reason is needed');
    await dialog.getByLabel('Reason').fill('the batch is rolled back');
    await r.picture('bulk-rollback');
    await confirm.focus();
    await r.page.keyboard.press('Enter');
    await titled('Rolling back 1 rig: ended');
    assert.equal(await dialog.getByRole('status').textContent(),
      'The version before is active on 1 of 1 rig.');
    await close();
    assert.equal((await r.api('rigs/tablet/calibrations/active')).version, before);

    const again = await askRollBack(r);
    await again.titled('Roll back: no rig to change');
    assert.deepEqual(await again.namesIn('Left out'), kLabelled);
    await again.dialog.getByText(/^It is rolled back already/).waitFor();
    await again.close();
    await r.change('POST', newest.name + ':activate', { reason: 'the test ends with it' });
    await r.shows('/rigs/tablet/events', 'Events of tablet', ['the batch is rolled back']);
  },

  async 'a roll-back leaves versions that are older than the given time'(r) {
    const { shown, activated, end } = await withVersions(r);
    shown.versions = [
      [5, 'REJECTED'], [4, 'ACTIVE'], [3, 'ROLLED_BACK'], [2, 'SUPERSEDED'], [1, 'SUPERSEDED'],
    ];
    const older = await askRollBack(r, { since: '10m' });
    await older.titled('Roll back: no rig to change');
    await older.dialog.getByText(/^Its active version 4 was created before, at /).waitFor();
    await older.close();

    const { dialog, titled } = await askRollBack(r, { since: 'soon' });
    await dialog.getByRole('alert').getByText("'soon' is not a time").waitFor();
    await r.picture('bulk-rollback-choices');
    const since = dialog.getByLabel(/^Only where/);
    await since.fill('2026-02-30');
    await dialog.getByRole('button', { name: 'Continue' }).click();
    await dialog.getByRole('alert').getByText("'2026-02-30' is not a time").waitFor();
    await since.fill('2h');
    await dialog.getByRole('button', { name: 'Continue' }).click();
    await titled('Roll back 1 rig?');
    await dialog.getByText('Only versions that were created since').waitFor();
    assert.deepEqual(await changesIn(dialog), { tablet: 'from version 4 to 2' });
    await r.page.keyboard.press('Escape');
    await dialog.waitFor({ state: 'detached' });
    assert.deepEqual(activated, []);

    // As a time in UTC, to the second before that of the versions.
    const dayBefore = new Date(Date.now() - 86_400_000).toISOString().slice(0, 19);
    const dated = await askRollBack(r, { since: dayBefore.replace('T', ' ') });
    await dated.titled('Roll back 1 rig?');
    await r.page.keyboard.press('Escape');
    await dated.dialog.waitFor({ state: 'detached' });
    await end();
  },

  async 'a roll-back goes further back on demand'(r) {
    const { shown, activated, end } = await withVersions(r);
    shown.versions = [
      [5, 'REJECTED'], [4, 'ROLLED_BACK'], [3, 'ROLLED_BACK'], [2, 'ACTIVE'], [1, 'SUPERSEDED'],
    ];
    const once = await askRollBack(r);
    await once.titled('Roll back: no rig to change');
    await once.dialog.getByText(/^It is rolled back already, from version 4 to 2/).waitFor();
    await once.close();

    const { dialog, titled, close } = await askRollBack(r, { again: true });
    await titled('Roll back 1 rig?');
    await dialog.getByText('are rolled back further').waitFor();
    assert.deepEqual(await changesIn(dialog), { tablet: 'from version 2 to 1' });
    await dialog.getByLabel('Reason').fill('both were bad');
    await dialog.getByRole('button', { name: 'Roll back', exact: true }).click();
    await titled('Rolling back 1 rig: ended');
    assert.equal(await dialog.getByRole('status').textContent(),
      'The version before is active on 1 of 1 rig.');
    await close();
    assert.deepEqual(activated, [['1:activate', { reason: 'both were bad' }]]);
    await end();
  },

  async 'rigs of a filter are labelled, and their other labels stay'(r) {
    const label = (rig, labels) => {
      const name = 'rigs/' + rig;
      return r.change('PATCH', name + '?updateMask=labels', { name, labels });
    };
    const labelsOf = async (rig) => (await r.api('rigs/' + rig)).labels;
    const { dialog, namesIn, titled, close } = await ask(r, 'Label these rigs');
    await label('phone-001', { batch: 'bulk', site: 'lab' });
    await label('tablet', { batch: 'bulk', site: 'north', owner: 'me' });
    const go = dialog.getByRole('button', { name: 'Continue' });
    await go.click();
    await dialog.getByRole('alert').getByText('There is nothing to change').waitFor();
    const set = dialog.getByLabel(/^Labels to set/);
    await set.fill('nonsense');
    await go.click();
    await dialog.getByRole('alert').getByText("'nonsense' is not a label").waitFor();
    await set.fill('site = lab');
    await dialog.getByLabel(/^Labels to remove/).fill('owner\n');
    await r.picture('bulk-labels');
    await go.click();
    await titled('Label 2 rigs?');
    assert.deepEqual(await changesIn(dialog), {
      'phone-002': 'site = lab',
      tablet: 'site = lab (now north), without owner',
    });
    assert.deepEqual(await namesIn('Left out'), ['phone-001']);
    assert.deepEqual(await labelsOf('phone-002'), { batch: 'bulk' }, 'changed without consent');
    await dialog.getByRole('button', { name: 'Label', exact: true }).click();
    await titled('Labelling 2 rigs: ended');
    assert.equal(
      await dialog.getByRole('status').textContent(), 'The labels were changed on 2 of 2 rigs.');
    await close();
    for (const rig of kLabelled) {
      assert.deepEqual(await labelsOf(rig), { batch: 'bulk', site: 'lab' });
    }
  },

  async 'rigs of a filter are configured, and a refusal does not hold up the others'(r) {
    const settings = {
      calibrationMaxAge: '604800s', recalibrationMinInterval: '43200s', retriggerFraction: 0.75,
    };
    const configure = (rig, values) => {
      const name = 'rigs/' + rig;
      return r.change('PATCH', `${name}?updateMask=${Object.keys(settings)}`, { name, ...values });
    };
    const before = await r.api('rigs/tablet');
    const { dialog, namesIn, titled, close } = await ask(r, 'Configure these rigs');
    await configure('phone-001', settings);
    const fill = (name, text) => dialog.getByLabel(name).fill(text);
    const go = dialog.getByRole('button', { name: 'Continue' });
    await fill('calibration_max_age', '1 week');
    await go.click();
    await dialog.getByRole('alert').getByText("'1 week' is not a value").waitFor();
    await fill('calibration_max_age', '7 d');
    await fill('recalibration_min_interval', '12 h');
    await fill('retrigger_fraction', '0.75');
    await r.picture('bulk-settings');
    await go.click();
    await titled('Configure 2 rigs?');
    const change = 'recalibration_min_interval: none to 12 h, calibration_max_age: none to 7 d, ' +
      'retrigger_fraction: 0.5 to 0.75';
    assert.deepEqual(await changesIn(dialog), { 'phone-002': change, tablet: change });
    assert.deepEqual(await namesIn('Left out'), ['phone-001']);
    // As for a caller without a role on one of the rigs.
    const isRefused = (url) => url.pathname === '/api/v1/rigs/phone-002';
    const error = { code: 'PERMISSION_DENIED', message: 'that is not yours', whatToDo: '' };
    await r.page.route(isRefused, (route) => route.fulfill({ status: 403, json: error }));
    r.expectProblems = true;
    await dialog.getByRole('button', { name: 'Configure', exact: true }).click();
    await titled('Configuring 2 rigs: ended');
    assert.equal(
      await dialog.getByRole('status').textContent(), 'The settings were changed on 1 of 2 rigs.');
    assert.deepEqual(await namesIn('Failed'), ['phone-002']);
    await dialog.getByText('that is not yours').waitFor();
    await close();
    await r.page.unroute(isRefused);
    r.expectProblems = false;
    // Nothing but these settings has changed.
    const after = await r.api('rigs/tablet');
    assert.deepEqual(after, { ...before, labels: after.labels, ...settings });
    for (const rig of ['phone-001', 'tablet']) await configure(rig, {});
    assert.deepEqual(await r.api('rigs/tablet'), { ...before, labels: after.labels });
  },

  async 'changes of many rigs can be stopped'(r) {
    let release;
    const released = new Promise((resolve) => {
      release = resolve;
    });
    const isStart = (url) => /^\/api\/v1\/rigs\/phone-\d+\/recalibrations$/.test(url.pathname);
    const error = { code: 'FAILED_PRECONDITION', message: 'it was held up', whatToDo: '' };
    await r.page.route(isStart, async (route) => {
      await released;
      await route.fulfill({ status: 409, json: error });
    });
    r.expectProblems = true;
    await r.open('/?' + queryOf({ filter: 'phone-' }), 'Rigs');
    const rigs = (await r.api('activity?page_size=1000&filter=phone-')).rigs.length;
    await r.page.getByRole('button', { name: 'Recalibrate these rigs' }).click();
    const dialog = r.page.getByRole('dialog');
    await dialog.getByRole('heading', { name: `Recalibrate ${rigs} rigs?` }).waitFor();
    await dialog.getByRole('button', { name: 'Recalibrate', exact: true }).click();
    await dialog.getByRole('button', { name: 'Stop' }).click();
    release();
    await dialog.getByText(/^A run was started on 0 of \d+ rigs\. Stopped before/).waitFor();
    const failed = await dialog.getByRole('region', { name: 'Failed' }).locator('tbody th').count();
    assert.ok(failed > 0 && failed < rigs, `${failed} of ${rigs} failed`);
    await dialog.getByText(`Stopped before ${rigs - failed} rigs.`).waitFor();
    await dialog.getByRole('button', { name: 'Close' }).click();
    await r.page.unroute(isStart);
    r.expectProblems = false;
  },

  async 'a caller who may only read is offered no changes'(r) {
    const isCaller = (url) => url.pathname === '/api/v1/caller';
    await r.page.route(isCaller, (route) => route.fulfill({
      json: { name: 'reader', programVersion: '1', grants: [{ role: 'read', rig: '', label: '' }] },
    }));
    await r.open('/?' + queryOf({ filter: 'tab' }), 'Rigs');
    await r.sees('as reader.');
    await r.rows((names) => names.join() === 'tablet');
    assert.equal(await r.page.getByRole('button', { name: /these rigs/ }).count(), 0);
    await r.page.unroute(isCaller);
  },
};
