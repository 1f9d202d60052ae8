// Looks at every page on a phone, a laptop and a wide screen, with names as long
// as the daemon accepts them: nothing is wider than the window, no names overlap,
// and every chart has ticks.
import assert from 'node:assert/strict';
import { until } from './reader.mjs';

const kWidths = { 390: 844, 1280: 800, 2560: 1440 };
const kLongRig = 'headset-with-a-long-name-'.padEnd(63, 'x');
const kLongSession = 'session-with-a-long-name-'.padEnd(128, 'y');
const kLeastTicks = 3;

// The pages of a rig that has one session and at least two versions.
function pagesOf(rig, session, segment) {
  const page = (rest) => `/rigs/${rig}${rest}`;
  return {
    overview: page(''),
    sessions: page('/sessions'),
    session: page('/sessions/' + session),
    coach: page('/coach'),
    segments: page('/segments'),
    segment: page('/segments/' + segment),
    calibrations: page('/calibrations'),
    calibration: page('/calibrations/2'),
    recalibrations: page('/recalibrations'),
    recalibration: page('/recalibrations/1'),
    events: page('/events'),
    instructions: page('/instructions'),
  };
}

// What is wrong with the layout of the page, as a list of sentences.
function layoutProblems(leastTicks) {
  const problems = [];
  const { scrollWidth, clientWidth } = document.documentElement;
  if (scrollWidth > clientWidth) problems.push(`the page is ${scrollWidth - clientWidth} px too wide`);
  const text = (e) => e.textContent.slice(0, 60);
  const visible = [...document.querySelectorAll('main a, main h1, main dd, main button')].filter(
    (e) => e.checkVisibility() && e.getClientRects().length > 0,
  );
  // The lines of an element, each a rectangle.
  const lines = new Map(visible.map((e) => [e, [...e.getClientRects()]]));
  const meet = (a, b) =>
    Math.min(a.right, b.right) - Math.max(a.left, b.left) > 1 &&
    Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top) > 1;
  visible.forEach((a, i) => {
    const inTable = a.closest('.scroll') !== null;
    if (!inTable && lines.get(a).some((line) => line.right > clientWidth + 1)) {
      problems.push('outside the window: ' + text(a));
    }
    const cell = a.closest('td, th, li')?.getBoundingClientRect();
    if (cell && lines.get(a).some((line) => line.right > cell.right + 1)) {
      problems.push('outside its cell: ' + text(a));
    }
    for (const b of visible.slice(i + 1)) {
      if (a.contains(b) || b.contains(a)) continue;
      if (lines.get(a).some((one) => lines.get(b).some((other) => meet(one, other)))) {
        problems.push(`overlap: ${text(a)} and ${text(b)}`);
      }
    }
  });
  for (const canvas of document.querySelectorAll('.plot .canvas')) {
    for (const axis of ['xTicks', 'yTicks']) {
      const ticks = (canvas.dataset[axis] ?? '').split('|');
      const least = canvas.clientWidth < 400 ? 2 : leastTicks;
      if (ticks.length < least || new Set(ticks).size < ticks.length) {
        problems.push(`${axis} of ${canvas.getAttribute('aria-label')}: ${ticks}`);
      }
    }
  }
  for (const scene of document.querySelectorAll('.orbit')) {
    if (scene.querySelectorAll('.ticks text').length < leastTicks) {
      problems.push('a path without ticks: ' + scene.getAttribute('aria-label'));
    }
  }
  return problems;
}

async function checkPages(r, pages, name) {
  for (const [page, address] of Object.entries(pages)) {
    await r.page.goto(r.base + address);
    await r.page.locator('h1').waitFor();
    await r.page.waitForLoadState('load');
    await r.settled();
    for (const [width, height] of Object.entries(kWidths)) {
      await r.page.setViewportSize({ width: Number(width), height });
      await r.page.waitForTimeout(300);
      const picture = `${name}${page}-${width}`;
      await r.picture(picture);
      assert.deepEqual(await r.page.evaluate(layoutProblems, kLeastTicks), [], picture);
    }
  }
  await r.page.setViewportSize({ width: 1200, height: 800 });
}

const kFleetPages = {
  rigs: '/',
  'all-segments': '/segments',
  'all-calibrations': '/calibrations',
  'all-recalibrations': '/recalibrations',
  'all-events': '/events',
  parameters: '/parameters',
  cohorts: '/cohorts',
};

export const layoutTests = {
  async 'every page fits a phone, a laptop and a wide screen'(r) {
    const { tables } = await r.api('rigs/tablet/tables');
    const kept = tables[0].entries[0].segment.split('/').pop();
    const pages = pagesOf('tablet', 'walk', kept);
    await checkPages(r, { ...kFleetPages, ...pages }, 'fits-');
  },

  async 'names of 63 and sessions of 128 characters fit, too'(r, other, daemon, send) {
    const { factory, ...rig } = await r.api('rigs/headset');
    await r.change('POST', 'rigs', { ...rig, factory, name: 'rigs/' + kLongRig });
    await send([daemon.address, kLongRig, kLongSession, '20']);
    await until('a version of the rig with a long name', async () => {
      const { recalibrations } = await r.api(`rigs/${kLongRig}/recalibrations`);
      return recalibrations.length > 0 && recalibrations.every((run) => run.state === 'SUCCEEDED');
    });
    const pages = pagesOf(kLongRig, kLongSession, kLongSession + '~0');
    await checkPages(r, { ...kFleetPages, ...pages }, 'long-');
  },
};
