import { idOf, rigPath } from '../api';
import type { Instruction, ListInstructionsResponse } from '../contract';
import { words } from '../format';
import { ListPage } from '../list';
import { Badge, When } from '../parts';
import type { Column } from '../table';

// The request of an instruction, in words.
function requestOf(instruction: Instruction): string {
  const { activateCalibration, updateRig, startRecalibration, quarantineSegments } = instruction;
  if (activateCalibration) {
    return `activate version ${idOf(activateCalibration.name)}: ${activateCalibration.reason}`;
  }
  if (updateRig) return 'change the rig';
  if (startRecalibration) return 'recalibrate';
  if (quarantineSegments) {
    const { session, index, reason } = quarantineSegments;
    const which =
      index === undefined ? `segments of session ${session}` : `segment ${session}~${index}`;
    return `quarantine ${which}: ${reason}`;
  }
  return 'unknown';
}

const kColumns: Column<Instruction>[] = [
  {
    head: 'Instruction',
    cell: (instruction) => idOf(instruction.name),
    value: (instruction) => Number(idOf(instruction.name)),
  },
  {
    head: 'State',
    cell: (instruction) => <Badge state={instruction.state} />,
    value: (instruction) => words(instruction.state),
  },
  { head: 'What', cell: requestOf, value: requestOf, wide: true },
  {
    head: 'Given',
    cell: (instruction) => <When time={instruction.createTime} />,
    value: (instruction) => Date.parse(instruction.createTime ?? ''),
  },
  {
    head: 'By',
    cell: (instruction) => instruction.caller,
    value: (instruction) => instruction.caller,
  },
  {
    head: 'Message',
    cell: (instruction) => instruction.message,
    value: (instruction) => instruction.message,
    wide: true,
  },
];

export function Instructions(props: { rig: string; version: number }) {
  return (
    <ListPage
      title={'Instructions for ' + props.rig}
      path={rigPath(props.rig) + '/instructions'}
      items={(response: ListInstructionsResponse) => response.instructions}
      version={props.version}
      columns={kColumns}
      next="Older instructions"
      empty={
        <>
          There are no instructions. At a hub, <code>selfcal calibration activate</code>,{' '}
          <code>selfcal rig update</code> and others give some to the device that reports the rig.
        </>
      }
    />
  );
}
