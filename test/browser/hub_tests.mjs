// Changes rigs that devices report to a hub, which instructs the devices.
import assert from 'node:assert/strict';
import { ask } from './bulk_tests.mjs';

// Shows the pages as at a hub to which devices report the rigs whose names begin
// so, and takes and lists the instructions for `rig`.
async function asHub(r, prefix, rig) {
  const isActivity = (url) => url.pathname === '/api/v1/activity';
  await r.page.route(isActivity, async (route) => {
    const response = await route.fetch();
    const listed = await response.json();
    for (const each of listed.rigs) {
      if (each.name.startsWith('rigs/' + prefix)) {
        each.device = { waiting: '0', programVersion: '1' };
      }
    }
    await route.fulfill({ response, json: listed });
  });
  const given = [];
  const isInstruction = (url) => url.pathname === `/api/v1/rigs/${rig}/instructions`;
  await r.page.route(isInstruction, async (route) => {
    const name = `rigs/${rig}/instructions/7`;
    if (route.request().method() === 'GET') {
      const createTime = new Date().toISOString();
      const instructions = given.map((call) =>
        ({ ...call, name, createTime, caller: 'local', state: 'PENDING', message: '' }));
      await route.fulfill({ json: { instructions, nextPageToken: '' } });
      return;
    }
    given.push(route.request().postDataJSON());
    await route.fulfill({ json: { name } });
  });
  const end = async () => {
    await r.page.unroute(isActivity);
    await r.page.unroute(isInstruction);
  };
  return { given, end };
}

// Until the page says that an instruction was given.
async function seesGiven(r, rig) {
  const note = r.page.getByRole('status').filter({ hasText: `Instruction 7 was given to the device of rig ${rig},` });
  const link = note.getByRole('link', { name: 'Instructions' });
  assert.equal(await link.getAttribute('href'), `/rigs/${rig}/instructions`);
}

// Asks on the page of a segment, SESSION~INDEX, of the tablet for its quarantine.
async function quarantine(r, segment, reason) {
  await r.open('/rigs/tablet/segments/' + segment, 'Segment ' + segment);
  await r.page.getByRole('button', { name: 'Quarantine' }).click();
  const dialog = r.page.getByRole('dialog');
  await dialog.getByText('it gets an instruction').waitFor();
  await dialog.getByLabel('Reason').fill(reason);
  await dialog.getByRole('button', { name: 'Quarantine' }).click();
  return dialog;
}

export const hubTests = {
  async 'the device of a rig that it reports is instructed'(r) {
    const { given, end } = await asHub(r, 'phone-', 'phone-001');
    r.expectProblems = true;
    const { dialog, namesIn, titled, close } = await ask(r, 'Recalibrate these rigs');
    await dialog.getByText('2 of them are reported by a device').waitFor();
    await dialog.getByRole('button', { name: 'Recalibrate', exact: true }).click();
    await titled('Recalibrating 3 rigs: ended');
    assert.deepEqual(given, [{ startRecalibration: { parent: 'rigs/phone-001', force: false } }]);
    await dialog.getByText('Instructions were given to the devices of 1 rig').waitFor();
    // This daemon understands the instruction, and knows of no device.
    assert.ok((await namesIn('Failed')).includes('phone-002'));
    await dialog.getByText('no device reports rig phone-002').waitFor();
    await close();
    await end();
    r.expectProblems = false;
  },

  async 'devices are instructed to change labels and settings'(r) {
    const { given, end } = await asHub(r, 'phone-', 'phone-001');
    r.expectProblems = true;
    const change = async (name, fill) => {
      const { dialog, namesIn, titled, close } = await ask(r, name + ' these rigs');
      await fill(dialog);
      await dialog.getByRole('button', { name: 'Continue' }).click();
      await titled(name + ' 3 rigs?');
      await dialog.getByText('2 of them are reported by a device').waitFor();
      await dialog.getByRole('button', { name, exact: true }).click();
      await dialog.getByText('Instructions were given to the devices of 1 rig').waitFor();
      // This daemon understands the instruction, and knows of no device.
      assert.deepEqual(await namesIn('Failed'), ['phone-002']);
      await dialog.getByText('no device reports rig phone-002').waitFor();
      await close();
    };
    await change('Label', (dialog) => dialog.getByLabel(/^Labels to set/).fill('site = lab'));
    await change('Configure', (dialog) => dialog.getByLabel('table_max_age').fill('30 d'));
    const name = 'rigs/phone-001';
    assert.deepEqual(given, [
      { updateRig: { rig: { name, labels: { batch: 'bulk', site: 'lab' } }, updateMask: 'labels' } },
      { updateRig: { rig: { name, tableMaxAge: '2592000s' }, updateMask: 'tableMaxAge' } },
    ]);
    // The hub changes nothing of a rig that a device reports, but its own rig.
    assert.equal((await r.api('rigs/phone-001')).tableMaxAge, undefined);
    assert.equal((await r.api('rigs/tablet')).tableMaxAge, '2592000s');
    await r.change('PATCH', 'rigs/tablet?updateMask=tableMaxAge', { name: 'rigs/tablet' });
    await end();
    r.expectProblems = false;
  },

  async 'a version of a rig that a device reports is activated by the device'(r) {
    const { version } = await r.api('rigs/tablet/calibrations/active');
    const { given, end } = await asHub(r, 'tablet', 'tablet');
    await r.open('/rigs/tablet/calibrations', 'Calibrations of tablet');
    await r.page.getByRole('button', { name: /Roll back|Activate/ }).last().click();
    const dialog = r.page.getByRole('dialog');
    await dialog.getByText('it gets an instruction').waitFor();
    await dialog.getByLabel('Reason').fill('the hub asks for it');
    await dialog.getByRole('button', { name: /Roll back|Activate/ }).click();
    await dialog.waitFor({ state: 'detached' });
    await seesGiven(r, 'tablet');
    await r.picture('activate-at-hub');
    assert.equal(given.length, 1);
    const { name, reason } = given[0].activateCalibration;
    assert.match(name, /^rigs\/tablet\/calibrations\/\d+$/);
    assert.equal(reason, 'the hub asks for it');
    assert.equal((await r.api('rigs/tablet/calibrations/active')).version, version);
    await end();
  },

  async 'a segment of a rig that a device reports is quarantined by the device'(r) {
    const { segments } = await r.api('rigs/tablet/segments?view=BASIC');
    const { name } = segments.find(({ state }) => state === 'SCORED');
    const segment = name.slice(name.lastIndexOf('/') + 1);
    const [session, index] = segment.split('~');
    const reason = 'the camera was covered';
    const { given, end } = await asHub(r, 'tablet', 'tablet');
    const dialog = await quarantine(r, segment, reason);
    await dialog.waitFor({ state: 'detached' });
    await seesGiven(r, 'tablet');
    await r.sees('only the device can delete the segment');
    assert.equal(await r.page.getByRole('button', { name: 'Delete' }).count(), 0);
    await r.picture('quarantine-at-hub');
    assert.deepEqual(given, [
      { quarantineSegments: { parent: 'rigs/tablet', session, index, reason } },
    ]);
    await r.page.getByRole('status').getByRole('link', { name: 'Instructions' }).click();
    await r.heading('Instructions for tablet');
    await r.sees(`quarantine segment ${segment}: ${reason}`);
    await end();

    // This daemon understands the instruction, and knows of no device.
    const toDaemon = await asHub(r, 'tablet', 'none');
    r.expectProblems = true;
    const refused = await quarantine(r, segment, reason);
    await refused.getByRole('alert').getByText('no device reports rig tablet').waitFor();
    await toDaemon.end();
    r.expectProblems = false;
    assert.equal((await r.api(name)).state, 'SCORED');
  },

  async 'a segment is not offered for deletion before it is known who reports the rig'(r) {
    const isActivity = (url) => url.pathname === '/api/v1/activity';
    let release;
    const released = new Promise((resolve) => {
      release = resolve;
    });
    await r.page.route(isActivity, async (route) => {
      await released;
      await route.continue();
    });
    const asked = r.page.waitForRequest((request) => isActivity(new URL(request.url())));
    await r.open('/rigs/tablet/segments/walk~0', 'Segment walk~0');
    await asked;
    await r.sees('from the session');
    const button = r.page.getByRole('button', { name: 'Delete', exact: true });
    assert.equal(await button.count(), 0);
    release();
    await button.waitFor();
    await r.page.unroute(isActivity);
  },

  async 'deleting a rig that a device reports deletes the copy at the hub'(r) {
    const { end } = await asHub(r, 'tablet', 'tablet');
    await r.open('/rigs/tablet', 'tablet');
    await r.page.getByRole('button', { name: 'Delete rig' }).click();
    const dialog = r.page.getByRole('dialog');
    await dialog.getByText('only the copy at this hub is deleted').waitFor();
    await dialog.getByRole('button', { name: 'Cancel' }).click();
    await dialog.waitFor({ state: 'detached' });
    await end();
  },

  async 'labels of a rig that a device reports are changed by the device'(r) {
    const { labels } = await r.api('rigs/tablet');
    const { given, end } = await asHub(r, 'tablet', 'tablet');
    await r.open('/rigs/tablet', 'tablet');
    await r.sees('Last report of the device');
    await r.page.getByRole('button', { name: 'Edit labels' }).click();
    await r.page.getByRole('dialog').getByRole('textbox').fill('site = hub');
    await r.page.getByRole('button', { name: 'Save' }).click();
    await seesGiven(r, 'tablet');
    const rig = { name: 'rigs/tablet', labels: { site: 'hub' } };
    assert.deepEqual(given, [{ updateRig: { rig, updateMask: 'labels' } }]);
    assert.deepEqual((await r.api('rigs/tablet')).labels, labels);
    await end();
  },
};
