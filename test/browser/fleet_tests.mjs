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
