// Which motion would teach a rig the most now; for whoever holds the device.
import { pageOf, rigPath, type Advice, type Coaching } from '../api';
import { component, number, quantity, words } from '../format';
import { DataTable, Link, Problem, Title } from '../parts';
import { useCalm, useRead } from '../state';

const kAll = 100; // more than there are motions
// Between two answers: a segment takes longer to record.
const kLeastMs = 2000;
// A motion that makes sigmas less than this part smaller teaches nothing much.
const kHardly = 0.02;

// Of all directions of what is estimated, in the geometric mean.
function shrink(advice: Advice): number {
  return 1 - Math.exp(-advice.gainNats / Math.max(1, advice.sigmaChanges.length));
}

function Sharpens(props: { of: Advice }) {
  const changes = props.of.sigmaChanges;
  if (changes.length === 0) return null;
  const ratio = (c: (typeof changes)[number]) => c.sigmaAfter / c.sigmaNow;
  const best = changes.reduce((a, b) => (ratio(b) < ratio(a) ? b : a));
  return (
    <>
      {component(best.component)}: sigma {number(best.sigmaNow)} to{' '}
      {quantity(best.sigmaAfter, best.unit, 3)}
    </>
  );
}

function Best(props: { of: Advice; seconds: number }) {
  const part = shrink(props.of);
  return (
    <div class="box advice" aria-live="polite">
      <p class="instruction">{props.of.instruction}</p>
      {part < kHardly ? (
        <p>
          Nothing teaches much now: {number(props.seconds)} s of it make the
          uncertainty {number(100 * part, 2)} % smaller. A new calibration, or
          other surroundings, may bring more.
        </p>
      ) : (
        <p>
          Expected of {number(props.seconds)} s: the uncertainty becomes{' '}
          <strong>{number(100 * part, 2)} % smaller</strong> in the mean over all
          directions (gain {number(props.of.gainNats)} nats). Most of all,{' '}
          <Sharpens of={props.of} />.
        </p>
      )}
    </div>
  );
}

function Motions(props: { of: Coaching }) {
  return (
    <>
      <h2>All motions</h2>
      <DataTable
        caption={`What a segment of ${number(props.of.segmentSeconds)} s would bring`}
        head={['Motion', 'What to do', 'Smaller by', 'Gain [nats]', 'By group [nats]', 'Sharpens most']}
        rows={props.of.advice.map((advice) => [
          words(advice.motion),
          advice.instruction,
          number(100 * shrink(advice), 2) + ' %',
          number(advice.gainNats),
          advice.groupGains.map((g) => `${g.group} ${number(g.gainNats, 2)}`).join(', '),
          <Sharpens of={advice} />,
        ])}
      />
    </>
  );
}

function Weakest(props: { of: Coaching['weakest'] }) {
  return (
    <>
      <h2>What is known worst</h2>
      <p class="quiet">
        In sigmas of what one usual segment gives: a new device begins at about 10.
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
  const read = useRead<Coaching>(`${rigPath(props.rig)}/coach?max_advice=${kAll}`, version);
  const title = 'Coach of ' + props.rig;
  const coaching = read.value;
  return (
    <>
      <Title text={title}>{title}</Title>
      {read.error && <Problem error={read.error} />}
      {!read.error && !coaching && (
        <p role="status">
          Each motion is simulated with this device's own calibration. The first
          answer about a version takes a few seconds ...
        </p>
      )}
      {coaching && (
        <>
          <Best of={coaching.advice[0]} seconds={coaching.segmentSeconds} />
          <p class="quiet" aria-busy={read.busy}>
            From{' '}
            <Link to={`${pageOf('rigs/' + props.rig)}/calibrations/${coaching.calibrationVersion}`}>
              version {coaching.calibrationVersion}
            </Link>{' '}
            and {coaching.segmentsSince}{' '}
            {coaching.segmentsSince === 1 ? 'segment' : 'segments'} that a table
            holds beyond it; follows the segments as they come.
            {read.busy && ' Working it out anew ...'}
          </p>
          <Weakest of={coaching.weakest} />
          <Motions of={coaching} />
        </>
      )}
    </>
  );
}
