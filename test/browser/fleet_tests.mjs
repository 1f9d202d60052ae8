// Lists segments, versions and runs of all rigs.
import assert from 'node:assert/strict';
import { until } from './reader.mjs';

const kPage = 50; // rows of a list

const idOf = (name) => decodeURIComponent(name.slice(name.lastIndexOf('/') + 1));
const rigOf = (item) => item.name.split('/')[1];
const queryOf = (query) => new URLSearchParams(query).toString();

// Until the rows, each with its first texts, are those of the items.
async function showsItems(r, items, itemText) {
  const expected = items.map((item) => `${itemText(item)} of ${rigOf(item)}`).join();
  await until('the rows ' + expected, async () => {
    const rows = await r.page
      .locator('tbody tr[data-index]')
      .evaluateAll((all) => all.map((row) => [...row.children].slice(0, 2)
        .map((cell) => cell.textContent).join(' of ')));
    return rows.join() === expected;
  });
}

// The texts of the column whose head begins so.
async function column(r, head) {
  const heads = await r.page.locator('thead th').allTextContents();
  const at = heads.findIndex((text) => text.startsWith(head));
  assert.ok(at >= 0, `no column ${head}`);
  return r.page.locator(`tbody tr[data-index] > :nth-child(${at + 1})`).allTextContents();
}

// Whether a number is shown with the three digits that a page has of it.
const near = (shown, value) => Math.abs(shown - value) <= 0.005 * Math.abs(value) + 1e-9;

const versionText = ({ version }) => (version === '1' ? '1 (factory)' : version);
const isNewestFirst = (items, timeOf) =>
  items.every((item, i) => i === 0 || Date.parse(timeOf(items[i - 1])) >= Date.parse(timeOf(item)));

export const fleetTests = {
  async 'segments of all rigs are listed, newest first, and filtered by rig'(r) {
    await r.open('/', 'Rigs');
    const pages = r.page.getByRole('navigation', { name: 'Pages of all rigs' });
    await pages.getByRole('link', { name: 'Segments' }).click();
    await r.heading('Segments');
    const { segments, nextPageToken } = await r.api(`segments?view=BASIC&page_size=${kPage}`);
    assert.ok(isNewestFirst(segments, (s) => s.receiveTime));
    assert.ok(new Set(segments.map(rigOf)).size > 1, 'all segments are of one rig');
    await showsItems(r, segments, (s) => idOf(s.name));
    assert.equal(
      await r.page.getByRole('link', { name: 'Next segments' }).count(), nextPageToken ? 1 : 0);
    await r.picture('all-segments');
    // Both filters hold: that of the rigs, and that of the segments.
    await r.page.getByLabel('Rigs', { exact: true }).fill('name = tablet');
    await r.page.getByLabel('Filter', { exact: true }).fill('in_table = imu');
    await r.page.keyboard.press('Enter');
    const kept = await r.api('rigs/tablet/segments?' + queryOf({ filter: 'in_table = imu' }));
    assert.ok(kept.segments.length > 0);
    await showsItems(r, kept.segments, (s) => idOf(s.name));
    const group = await r.page.getByLabel('Scores of').inputValue();
    await r.page.getByRole('link', { name: 'Gain [nat]' }).click();
    const sorted = await r.api('rigs/tablet/segments?' +
      queryOf({ filter: 'in_table = imu', order_by: `gain.${group} desc` }));
    await showsItems(r, sorted.segments, (s) => idOf(s.name));
    await r.page.locator('tbody th').first().getByRole('link').click();
    await r.heading('Segment ' + idOf(sorted.segments[0].name));
  },

  async 'versions of all rigs are listed in pages, with their rigs and runs'(r) {
    await r.open('/calibrations', 'Calibrations');
    const query = { view: 'BASIC', page_size: kPage };
    const first = await r.api('calibrations?' + queryOf(query));
    assert.equal(first.calibrations.length, kPage);
    assert.ok(isNewestFirst(first.calibrations, (c) => c.createTime));
    await showsItems(r, first.calibrations, versionText);
    await r.picture('all-calibrations');
    await r.page.getByRole('link', { name: 'Older versions' }).click();
    await r.page.getByRole('link', { name: 'First page' }).waitFor();
    const second = await r.api('calibrations?' +
      queryOf({ ...query, page_token: first.nextPageToken }));
    await showsItems(r, second.calibrations, versionText);
    // The filter leads to the first page of its rigs.
    await r.page.getByLabel('Rigs', { exact: true }).fill('name = tablet');
    const own = await r.api('rigs/tablet/calibrations?' + queryOf(query));
    await showsItems(r, own.calibrations, versionText);
    assert.doesNotMatch(r.page.url(), /page_token/);
    const computed = own.calibrations.find((c) => c.provenance);
    const run = idOf(computed.provenance.recalibration);
    await r.page.getByRole('link', { name: `run ${run}`, exact: true }).first().click();
    await r.heading(`Run ${run} of tablet`);
  },

  async 'runs of all rigs are listed, and the filter stays from page to page'(r) {
    await r.open('/recalibrations', 'Runs');
    const all = await r.api(`recalibrations?page_size=${kPage}`);
    assert.ok(isNewestFirst(all.recalibrations, (run) => run.createTime));
    await showsItems(r, all.recalibrations, (run) => idOf(run.name));
    await r.picture('all-recalibrations');
    await r.open('/?' + queryOf({ filter: 'tab' }), 'Rigs');
    const pages = r.page.getByRole('navigation', { name: 'Pages of all rigs' });
    await pages.getByRole('link', { name: 'Runs' }).click();
    await r.heading('Runs');
    assert.equal(await r.page.getByLabel('Rigs', { exact: true }).inputValue(), 'tab');
    const own = await r.api('rigs/tablet/recalibrations');
    await showsItems(r, own.recalibrations, (run) => idOf(run.name));
    await pages.getByRole('link', { name: 'Overview' }).click();
    await r.rows((names) => names.join() === 'tablet');
    await pages.getByRole('link', { name: 'Runs' }).click();
    await r.page.locator('tbody th').first().getByRole('link').click();
    await r.heading(`Run ${idOf(own.recalibrations[0].name)} of tablet`);
  },

  async 'segments of all rigs are chosen by menus and sorted by motion'(r) {
    const { segments } = await r.api('segments?view=BASIC&page_size=1000');
    const all = await Promise.all(segments.map((s) => r.api(s.name)));
    const replaced = all.filter((s) => s.exclusions.some((e) => e.cause === 'REPLACED'));
    assert.ok(replaced.length > 1 && replaced.length < all.length, 'not some are replaced');
    await r.open('/segments', 'Segments');
    await r.page.getByLabel('Exclusion').selectOption('REPLACED');
    await showsItems(r, replaced, (s) => idOf(s.name));
    // The conditions of the menus and of the field all hold.
    const rates = replaced.map((s) => s.motion.angularRate).sort((a, b) => b - a);
    const least = rates[Math.floor(rates.length / 2)];
    const filter = `angular_rate >= ${least}`;
    await r.page.getByLabel('Filter', { exact: true }).fill(filter);
    await r.page.keyboard.press('Enter');
    const fast = replaced.filter((s) => s.motion.angularRate >= least);
    await showsItems(r, fast, (s) => idOf(s.name));
    await r.page.getByRole('link', { name: 'Angular rate' }).click();
    const fastest = [...fast].sort((a, b) => b.motion.angularRate - a.motion.angularRate);
    await showsItems(r, fastest, (s) => idOf(s.name));
    await r.sees('Rows without a value in the sorted column are not listed.');
    for (const [head, of] of [['Angular rate', 'angularRate'], ['Acceleration', 'acceleration']]) {
      const shown = await column(r, head);
      shown.forEach((text, i) => assert.ok(near(Number(text), fastest[i].motion[of]), `${head}: ${text}`));
    }
    await r.picture('all-segments-filtered');
    // All of it is in the address.
    await r.page.reload();
    await showsItems(r, fastest, (s) => idOf(s.name));
    assert.equal(await r.page.getByLabel('Exclusion').inputValue(), 'REPLACED');
    assert.equal(await r.page.getByLabel('Filter', { exact: true }).inputValue(), filter);
    await r.page.locator('th[aria-sort=descending]', { hasText: 'Angular rate' }).waitFor();
    await r.page.getByRole('link', { name: 'Acceleration' }).click();
    await showsItems(r, [...fast].sort((a, b) => b.motion.acceleration - a.motion.acceleration),
      (s) => idOf(s.name));
    // What the daemon sorts for one rig alone is not offered here.
    assert.equal(await r.page.getByRole('link', { name: 'Landmarks' }).count(), 0);
    await r.page.getByLabel('State').selectOption('STORED');
    await r.sees('No segment matches');
    await r.page.getByRole('link', { name: 'Show all, newest first' }).click();
    await showsItems(r, segments.slice(0, kPage), (s) => idOf(s.name));
    assert.equal(await r.page.getByLabel('Exclusion').inputValue(), '');
    await r.open('/' + fastest[0].name, 'Segment ' + idOf(fastest[0].name));
    await r.sees('Angular rate (root mean square)');
  },

  async 'versions of all rigs are chosen by state and verdict, and sorted by age'(r) {
    const { calibrations } = await r.api('calibrations?view=BASIC&page_size=1000');
    const { verdict } = calibrations.find((c) => c.provenance && c.state === 'ACTIVE');
    const of = (kind) => calibrations.filter((c) => c.verdict.kind === kind);
    await r.open('/calibrations', 'Calibrations');
    await r.page.getByLabel('Verdict').selectOption('FACTORY');
    await showsItems(r, of('FACTORY').slice(0, kPage), versionText);
    await r.page.getByLabel('Verdict').selectOption(verdict.kind);
    await showsItems(r, of(verdict.kind).slice(0, kPage), versionText);
    await r.page.getByLabel('State').selectOption('ACTIVE');
    const active = of(verdict.kind).filter((c) => c.state === 'ACTIVE');
    await showsItems(r, active.slice(0, kPage), versionText);
    await r.page.getByLabel('Verdict').selectOption('');
    const all = calibrations.filter((c) => c.state === 'ACTIVE');
    assert.ok(all.length > active.length);
    await showsItems(r, all.slice(0, kPage), versionText);
    await r.page.getByRole('link', { name: 'Created' }).click();
    const oldest = [...all].reverse();
    await showsItems(r, oldest.slice(0, kPage), versionText);
    assert.match(r.page.url(), /state=ACTIVE/);
    await r.page.reload();
    await showsItems(r, oldest.slice(0, kPage), versionText);
    await r.page.locator('th[aria-sort=ascending]', { hasText: 'Created' }).waitFor();
    await r.page.getByRole('link', { name: 'Temperature' }).click();
    const warmest = all.filter((c) => c.provenance?.temperature)
      .sort((a, b) => b.provenance.temperature.meanC - a.provenance.temperature.meanC);
    if (warmest.length > 0) await showsItems(r, warmest.slice(0, kPage), versionText);
    else await r.sees('No version matches');
  },

  async 'runs are chosen by state and trigger, and sorted by duration'(r) {
    const { recalibrations } = await r.api('recalibrations?page_size=1000');
    const full = recalibrations.filter((run) => run.trigger === 'TABLES_FULL');
    assert.ok(full.length > 0 && full.length < recalibrations.length);
    await r.open('/recalibrations', 'Runs');
    await r.page.getByLabel('Trigger').selectOption('TABLES_FULL');
    await showsItems(r, full, (run) => idOf(run.name));
    await r.page.getByLabel('State').selectOption('FAILED');
    const failed = full.filter((run) => run.state === 'FAILED');
    if (failed.length > 0) await showsItems(r, failed, (run) => idOf(run.name));
    else await r.sees('No run matches');
    // The runs of one rig have the same controls.
    await r.open('/rigs/tablet/recalibrations?' + queryOf({ state: 'SUCCEEDED' }), 'Runs of tablet');
    await r.page.getByRole('link', { name: 'Duration' }).click();
    const { recalibrations: own } = await r.api('rigs/tablet/recalibrations?page_size=1000');
    const durations = own.filter((run) => run.state === 'SUCCEEDED')
      .map((run) => (Date.parse(run.endTime) - Date.parse(run.createTime)) / 1000)
      .sort((a, b) => b - a);
    assert.ok(durations.length > 1);
    await until('the longest run first', async () => {
      const shown = (await column(r, 'Duration')).map(Number);
      return shown.length === durations.length && durations.every((s, i) => near(shown[i], s));
    });
    await r.picture('runs-filtered');
  },

  async 'a filter of a list across rigs that cannot be read says why beside its field'(r) {
    for (const [page, title] of [
      ['segments', 'Segments'], ['calibrations', 'Calibrations'], ['recalibrations', 'Runs'],
    ]) {
      await r.open('/' + page, title);
      await r.rows((names) => names.length > 0);
      r.expectProblems = true;
      const field = r.page.getByLabel('Filter', { exact: true });
      await field.fill('colour = 1');
      await r.page.getByRole('button', { name: 'Show' }).click();
      await r.page.locator('#filter-mistake').getByText("'colour' is not a field").waitFor();
      assert.equal(await field.getAttribute('aria-invalid'), 'true');
      assert.equal(await r.page.getByRole('alert').count(), 1);
      r.expectProblems = false;
      await field.fill('');
      await r.rows((names) => names.length > 0);
    }
  },

  async 'lists across rigs say that they are empty, or what a filter lacks'(r) {
    const none = queryOf({ rig_filter: 'name = phone-001' });
    await r.shows('/segments?' + none, 'Segments', ['None of these rigs has a segment']);
    await r.shows('/recalibrations?' + none, 'Runs', ['None of these rigs has a run']);
    const nothing = queryOf({ rig_filter: 'nothing' });
    await r.shows('/calibrations?' + nothing, 'Calibrations', ['No rig matches']);
    r.expectProblems = true;
    const wrong = queryOf({ rig_filter: 'nonsense = 1' });
    for (const [page, title] of [
      ['calibrations', 'Calibrations'], ['recalibrations', 'Runs'], ['segments', 'Segments'],
    ]) {
      await r.shows(`/${page}?${wrong}`, title, ['is not a condition']);
    }
    // On the page of segments, the other filter is not to blame.
    assert.equal(
      await r.page.getByLabel('Filter', { exact: true }).getAttribute('aria-invalid'), 'false');
    r.expectProblems = false;
  },
};
