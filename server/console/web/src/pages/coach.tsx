// The motion with the largest predicted gain, for the person who holds the
// device.
import { pageOf, rigPath } from '../api';
import type {
  AdviseMotionResponse,
  AdviseMotionResponse_Advice,
  AdviseMotionResponse_MissingDirection,
  AdviseMotionResponse_WeakDirection,
} from '../contract';
import { component, isSlope, number, shownUnit, sigmaText, words } from '../format';
import { Link, Problem, Title } from '../parts';
import { useCalm, useRead } from '../state';
import { DataTable, type Column } from '../table';

const kAll = 100; // more than there are motions
// Minimum time between updates; recording a segment takes longer.
const kLeastMs = 2000;
// A motion that reduces sigmas by less than this fraction is not worth it.
const kHardly = 0.02;

// The reduction of sigma, in the geometric mean over all estimated directions.
function shrink(advice: AdviseMotionResponse_Advice): number {
  return 1 - Math.exp(-advice.gainNats / Math.max(1, advice.sigmaChanges.length));
}

function LargestImprovement(props: { of: AdviseMotionResponse_Advice }) {
  const changes = props.of.sigmaChanges;
  if (changes.length === 0) return null;
  const ratio = (c: (typeof changes)[number]) => c.sigmaAfter / c.sigmaNow;
  const best = changes.reduce((a, b) => (ratio(b) < ratio(a) ? b : a));
  const { unit, factor } = shownUnit(best.unit);
  return (
    <>
      {component(best.component)}: standard deviation {sigmaText(factor * best.sigmaNow)} to{' '}
      {sigmaText(factor * best.sigmaAfter)} {unit === '-' ? '' : unit}
    </>
  );
}

function Best(props: { of: AdviseMotionResponse_Advice; seconds: number }) {
  const part = shrink(props.of);
  return (
    <div class="box advice" aria-live="polite">
      <p class="instruction">{props.of.instruction}</p>
      {part < kHardly ? (
        <p>
          No motion helps much now: {number(props.seconds)} s of it reduce the uncertainty by{' '}
          {number(100 * part, 2)} %. A new calibration, or other surroundings, may help more.
        </p>
      ) : (
        <p>
          Expected from {number(props.seconds)} s: the uncertainty becomes{' '}
          <strong>{number(100 * part, 2)} % smaller</strong> in the mean over all directions (gain{' '}
          {number(props.of.gainNats)} nat). Largest improvement:{' '}
          <LargestImprovement of={props.of} />.
        </p>
      )}
    </div>
  );
}

// Directions that are listed for a lesson; the least known come first.
const kShownDirections = 3;

function percent(part: number): string {
  return (100 * part).toFixed(part < 0.1 ? 1 : 0) + ' %';
}

function Directions(props: { of: AdviseMotionResponse_MissingDirection[]; taught: boolean }) {
  const more = props.of.length - kShownDirections;
  return (
    <ul>
      {props.of.slice(0, kShownDirections).map((missing) => (
        <li key={missing.words}>
          {missing.words}: {percent(missing.sigmaByPrior)}
          {props.taught && ' to ' + percent(missing.sigmaByPriorAfter)}
        </li>
      ))}
      {more > 0 && <li>and {more} more</li>}
    </ul>
  );
}

// The recordings that remain until no direction is missing, as `selfcal rig
// coach` prints them.
function Plan(props: { of: AdviseMotionResponse }) {
  const { lessons, missing } = props.of;
  const untaught = missing.filter((m) => m.motion === '');
  const isOfTemperature = (m: AdviseMotionResponse_MissingDirection) =>
    m.parts.some((part) => isSlope(part.component));
  const slopes = untaught.filter(isOfTemperature);
  const rest = untaught.filter((m) => !isOfTemperature(m));
  return (
    <>
      <h2>To be recorded</h2>
      {missing.length === 0 ? (
        <p>
          No direction is missing
          {lessons.length > 0 && ', but there are too few segments to confirm a calibration'}.
        </p>
      ) : (
        <p class="quiet">
          {missing.length} {missing.length === 1 ? 'direction is' : 'directions are'} missing:
          standard deviations in percent of those before any data, now and after all of this.
        </p>
      )}
      <ol class="plan">
        {lessons.map((lesson) => (
          <li key={lesson.motion}>
            <strong>{number(lesson.seconds)} s:</strong> {lesson.instruction}
            <Directions of={missing.filter((m) => m.motion === lesson.motion)} taught />
          </li>
        ))}
        {slopes.length > 0 && (
          <li>
            The same at temperatures 20 K or more apart:
            <Directions of={slopes} taught={false} />
          </li>
        )}
        {rest.length > 0 && (
          <li>
            No motion teaches these: hold them fixed, or state them better.
            <Directions of={rest} taught={false} />
          </li>
        )}
      </ol>
    </>
  );
}

const kMotions: Column<AdviseMotionResponse_Advice>[] = [
  {
    head: 'Motion',
    cell: (advice) => words(advice.motion),
    value: (advice) => words(advice.motion),
  },
  {
    head: 'Instruction',
    cell: (advice) => advice.instruction,
    value: (advice) => advice.instruction,
    wide: true,
  },
  {
    head: 'Uncertainty smaller by',
    cell: (advice) => number(100 * shrink(advice), 2) + ' %',
    value: shrink,
  },
  {
    head: 'Gain [nat]',
    cell: (advice) => number(advice.gainNats),
    value: (advice) => advice.gainNats,
  },
  {
    head: 'Gain of each group [nat]',
    cell: (advice) =>
      advice.groupGains.map((g) => `${g.group} ${number(g.gainNats, 2)}`).join(', '),
    wide: true,
  },
  {
    head: 'Largest improvement',
    cell: (advice) => <LargestImprovement of={advice} />,
    wide: true,
  },
];

function Motions(props: { of: AdviseMotionResponse }) {
  return (
    <>
      <h2>All motions</h2>
      <DataTable
        caption={`Predicted gain of a segment of ${number(props.of.segmentSeconds)} s`}
        columns={kMotions}
        items={props.of.advice}
      />
    </>
  );
}

function Weakest(props: { of: AdviseMotionResponse_WeakDirection[] }) {
  return (
    <>
      <h2>Least certain directions</h2>
      <p class="quiet">
        Standard deviations in reference sigmas: one usual segment reaches about 1, a new device
        starts at about 10.
      </p>
      <ol>
        {props.of.map((weak) => (
          <li key={weak.words}>
            {weak.words}: {number(weak.sigmaByReference)}
            {weak.parts.length > 1 && (
              <span class="quiet">
                {' '}
                ({weak.parts.map((p) => component(p.component)).join('; ')})
              </span>
            )}
          </li>
        ))}
      </ol>
    </>
  );
}

export function CoachPage(props: { rig: string; version: number }) {
  const version = useCalm(props.version, kLeastMs);
  const read = useRead<AdviseMotionResponse>(
    `${rigPath(props.rig)}:adviseMotion?max_advice=${kAll}`,
    version,
  );
  const title = 'Coach of ' + props.rig;
  const coaching = read.value;
  return (
    <>
      <Title text={title}>{title}</Title>
      {read.error && <Problem error={read.error} />}
      {!read.error && !coaching && (
        <p role="status">
          Simulating each motion with the calibration of this device. The first time for a version,
          this takes a few seconds ...
        </p>
      )}
      {coaching && (
        <>
          <Best of={coaching.advice[0]} seconds={coaching.segmentSeconds} />
          <p class="quiet" aria-busy={read.busy}>
            Based on{' '}
            <Link to={`${pageOf('rigs/' + props.rig)}/calibrations/${coaching.calibrationVersion}`}>
              version {coaching.calibrationVersion}
            </Link>{' '}
            and {coaching.segmentsSince} {coaching.segmentsSince === 1 ? 'segment' : 'segments'} in
            the tables that it does not use; updates when segments arrive.
            {read.busy && ' Updating ...'}
          </p>
          <Plan of={coaching} />
          <Weakest of={coaching.weakest} />
          <Motions of={coaching} />
        </>
      )}
    </>
  );
}
