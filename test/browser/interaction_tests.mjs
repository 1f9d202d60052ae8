// Sorts, filters and scrolls tables, and uses tables, plots and paths in space by
// keyboard alone.
import assert from 'node:assert/strict';
import { until } from './reader.mjs';

const focused = (r) => r.page.evaluate(() => document.activeElement.textContent);

export const interactionTests = {
  async 'a rig begins with the verdict, what changed and what to do'(r) {
    await r.open('/rigs/tablet', 'tablet');
    await r.sees('Compare all parameters');
    const headings = await r.page.locator('h2').allTextContents();
    assert.match(headings[0], /^Verdict: /);
    assert.deepEqual(headings.slice(1, 3), ['What changed', 'What to do']);
    await r.page.getByRole('link', { name: 'Compare all parameters' }).click();
    await r.heading('Calibrations of tablet');
    assert.match(r.page.url(), /a=\d+&b=\d+/);
  },

  async 'a hub shows the last report of a device'(r) {
    const device = { time: '2026-01-02T03:04:05Z', waiting: '12', programVersion: '1.2.3' };
    const isActivity = /\/api\/v1\/activity\?/;
    await r.page.route(isActivity, async (route) => {
      const response = await route.fetch();
      const activity = await response.json();
      for (const rig of activity.rigs) rig.device = device;
      await route.fulfill({ response, json: activity });
    });
    await r.open('/', 'Rigs');
    await r.sees(', 12 wait');
    await r.open('/rigs/tablet', 'tablet');
    for (const text of ['Last report of the device', 'Records waiting then', '1.2.3']) {
      await r.sees(text);
    }
    await r.page.unrouteAll({ behavior: 'wait' });
  },

  async 'a table is sorted by its heads and searched'(r) {
    await r.open('/rigs/tablet/calibrations?a=1&b=2', 'Calibrations of tablet');
    const table = r.page.getByRole('region', { name: 'Version 2 minus version 1' });
    const column = async (index) => table.locator(`tbody td:nth-child(${index})`).allTextContents();
    const sortedBy = async (direction) => {
      await table.getByRole('button', { name: 'In standard deviations' }).click();
      await table.locator(`th[aria-sort=${direction}]`, { hasText: 'In standard' }).waitFor();
      return (await column(5)).map((text) => Math.abs(Number(text)));
    };
    const sigmas = await sortedBy('descending');
    assert.ok(sigmas.length > 20);
    assert.deepEqual(sigmas, [...sigmas].sort((a, b) => b - a));
    assert.deepEqual(await sortedBy('ascending'), [...sigmas].sort((a, b) => a - b));
    const find = (text) =>
      r.page.getByLabel('Find in the table: Version 2 minus version 1').fill(text);
    const names = (areRight) =>
      until('the right rows', async () => areRight(await table.locator('tbody th').allTextContents()));
    await find('gyroscope');
    await names((all) => all.length === 6 && all.every((name) => name.includes('gyroscope')));
    await find('nothing');
    await r.sees("No row contains 'nothing'");
    // Rotations are compared in degrees, and every difference has its interval.
    await find('rotation');
    await names((all) => all.length === 6 && all.every((name) => name.includes('[°')));
    assert.ok((await table.locator('thead .ticks text').count()) >= 3);
  },

  async 'of a long list only the rows in view are in the page'(r) {
    await r.open('/?page_size=500', 'Rigs');
    const { rigs } = await r.api('activity?page_size=1000&order_by=name');
    const last = rigs[rigs.length - 1].name.split('/').pop();
    const rows = r.page.locator('tbody tr[data-index]');
    await rows.first().waitFor();
    assert.ok(rigs.length > 60 && (await rows.count()) < rigs.length, 'all rows are in the page');
    // The list is whole, so that also columns that the daemon cannot sort by do.
    await r.page.getByRole('button', { name: 'Active version' }).click();
    await r.rows((names) => names[0] === 'tablet' || names[0].startsWith('headset'));
    await r.page.getByRole('link', { name: 'Rig', exact: true }).click();
    await r.page.getByRole('link', { name: 'Rig', exact: true }).click();
    await r.page.locator('th[aria-sort=ascending]', { hasText: 'Rig' }).waitFor();
    await r.page.getByRole('region', { name: 'Rigs' }).focus();
    await r.page.keyboard.press('ArrowDown');
    await until('the first row', async () => (await focused(r)) === rigs[0].name.split('/').pop());
    await r.page.keyboard.press('ArrowDown');
    await until('the second row', async () => (await focused(r)) === rigs[1].name.split('/').pop());
    await r.page.keyboard.press('End');
    await until('the last row', async () => (await focused(r)) === last);
    await r.page.keyboard.press('Enter');
    await r.heading(last);
  },

  async 'a list is read 50 items at a time, and continued on demand'(r) {
    const read = [];
    const note = (request) => {
      const url = new URL(request.url());
      if (url.pathname === '/api/v1/activity') read.push(url.searchParams.get('page_size'));
    };
    r.page.on('request', note);
    await r.open('/', 'Rigs');
    const { rigs } = await r.api('activity?page_size=1000&order_by=name');
    const names = rigs.map((rig) => rig.name.split('/').pop());
    assert.ok(names.length > 50 && names.length < 100, 'two pages are needed');
    await r.rows((shown) => shown.join() === names.slice(0, 50).join());
    // A part of a list is not sorted by the page.
    assert.equal(await r.page.getByRole('button', { name: 'Active version' }).count(), 0);
    assert.deepEqual([...new Set(read)], ['50']);
    await r.page.getByRole('link', { name: 'Next rigs' }).click();
    await r.rows((shown) => shown.join() === names.slice(50).join());
    assert.equal(await r.page.getByRole('link', { name: 'Next rigs' }).count(), 0);
    r.page.off('request', note);
  },

  async 'rigs with alarms are listed alone'(r) {
    await r.open('/', 'Rigs');
    await r.page.locator('tbody tr').first().waitFor();
    await r.page.getByLabel('only with alarms').check();
    const { rigs } = await r.api('activity?page_size=1000&order_by=alarms%20desc&with_alarms=true');
    const all = await r.api('activity?page_size=1000');
    assert.ok(rigs.length < all.rigs.length && rigs.every(({ alarms }) => alarms.length > 0));
    if (rigs.length === 0) {
      await r.sees('No rig has alarms.');
    } else {
      await r.rows((names) => names[0] === rigs[0].name.split('/').pop());
    }
    await r.page.getByLabel('only with alarms').uncheck();
    await r.page.locator('tbody tr').first().waitFor();
  },

  async 'keys go to the search field and show themselves'(r) {
    await r.open('/rigs/tablet/segments', 'Segments of tablet');
    await r.sees('walk~0');
    await r.page.keyboard.press('/');
    assert.equal(await r.page.evaluate(() => document.activeElement.type), 'search');
    await r.page.keyboard.type('?');
    assert.equal(await r.page.getByRole('dialog').count(), 0, 'a key is taken from a field');
    await r.page.keyboard.press('Tab');
    await r.page.keyboard.press('?');
    await r.page.getByRole('dialog').waitFor();
    await r.picture('keys');
    await r.page.keyboard.press('Escape');
    await r.page.getByRole('dialog').waitFor({ state: 'detached' });
  },

  async 'a plot shows its values by keyboard, and a path rotates'(r) {
    await r.open('/rigs/tablet/calibrations', 'Calibrations of tablet');
    const plot = r.page.getByRole('slider', { name: /over time/ });
    await plot.focus();
    await r.page.keyboard.press('End');
    assert.match(await plot.getAttribute('aria-valuetext'), /^Version \d+, .* UTC: .* ± /);
    const newest = await plot.getAttribute('aria-valuetext');
    await r.page.keyboard.press('ArrowLeft');
    assert.notEqual(await plot.getAttribute('aria-valuetext'), newest);
    assert.equal(await r.page.locator('.values').textContent(), await plot.getAttribute('aria-valuetext'));

    await r.open('/rigs/tablet/sessions/walk', 'Session walk');
    const path = r.page.locator('path.strand').first();
    await path.waitFor();
    const scene = r.page.getByRole('application', { name: /^Path of the IMU/ });
    await scene.focus();
    let before = await path.getAttribute('d');
    const changes = async (act) => {
      await act();
      await until('another view', async () => (await path.getAttribute('d')) !== before);
      before = await path.getAttribute('d');
    };
    const first = before;
    await changes(() => r.page.keyboard.press('ArrowLeft'));
    await changes(() => r.page.keyboard.press('ArrowUp'));
    await changes(() => r.page.keyboard.press('+'));
    await changes(() => r.page.keyboard.press('Home'));
    assert.equal(before, first, 'Home does not reset the view');
    // By pointer: a drag rotates and does not open a segment.
    const box = await scene.boundingBox();
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    await changes(async () => {
      await r.page.mouse.move(x, y);
      await r.page.mouse.down();
      await r.page.mouse.move(x + 80, y + 20, { steps: 4 });
      await r.page.mouse.up();
    });
    await changes(() => r.page.mouse.wheel(0, 200));
    await r.heading('Session walk');
  },
};
