// One parameter over time, from version to version.
import { useMemo, useState } from 'preact/hooks';
import type uPlot from 'uplot';
import type { Calibration } from './contract';
import { clock, component, estimateText, heading, shown, words } from './format';
import { Choice } from './parts';
import { kColours, Plot, type PlotSeries } from './plot';
import { go, useAddress, withQuery } from './state';

const kBand = 2; // half width of the band, in sigmas

// The estimate in the unit in which it is shown.
function estimateOf(version: Calibration, name: string) {
  const estimate = version.estimates.find((e) => e.component === name);
  return estimate && shown(estimate);
}

const wasUsed = (version: Calibration) =>
  version.state !== 'REJECTED' && version.state !== 'CANDIDATE';

const bound = (label: string): PlotSeries => ({
  label,
  stroke: kColours[0] + '66',
  width: 1,
  points: { show: false },
});

const kRejected: PlotSeries = {
  label: 'rejected, not used',
  stroke: kColours[1],
  paths: () => null,
  points: { show: true, size: 8, stroke: kColours[1], fill: kColours[1] },
};

export function History(props: { of: Calibration[] }) {
  const query = useAddress().searchParams;
  const [factory, setFactory] = useState(props.of.length === 1);
  // The factory's sigmas are so large that later versions would look flat.
  const versions = useMemo(
    () => [...props.of].reverse().filter((v) => factory || v.version !== '1'),
    [props.of, factory],
  );
  const names = versions[0].estimates.filter((e) => e.sigma > 0).map((e) => e.component);
  const chosen = query.get('parameter') ?? names[0];
  const data = useMemo(() => {
    const at = versions.map((v) => estimateOf(v, chosen));
    const used = (i: number) => wasUsed(versions[i]);
    return [
      versions.map((v) => Date.parse(v.createTime!) / 1000),
      at.map((e, i) => (used(i) ? (e?.value ?? null) : null)),
      at.map((e, i) => (e && used(i) ? e.value + kBand * e.sigma : null)),
      at.map((e, i) => (e && used(i) ? e.value - kBand * e.sigma : null)),
      ...(versions.every(wasUsed) ? [] : [at.map((e, i) => (used(i) ? null : (e?.value ?? null)))]),
    ] as uPlot.AlignedData;
  }, [versions, chosen]);
  const describe = (index: number) => {
    const version = versions[index];
    const e = estimateOf(version, chosen);
    const estimate = e ? estimateText(e.value, e.sigma, e.unit) : 'not estimated';
    return `Version ${version.version}, ${words(version.state)}, ${clock(version.createTime)}: ${estimate}`;
  };
  const unit = estimateOf(versions[0], chosen)?.unit ?? '-';
  return (
    <section>
      <h2>History</h2>
      <div class="bar">
        <Choice
          label="Parameter"
          value={chosen}
          of={names.map((name) => [name, component(name)])}
          onChoice={(parameter) => go(withQuery({ parameter }), true)}
        />
        {props.of.length > 1 && (
          <label>
            <input
              type="checkbox"
              checked={factory}
              onChange={(event) => setFactory(event.currentTarget.checked)}
            />
            with the factory calibration
          </label>
        )}
      </div>
      <Plot
        label={`${component(chosen)} over time, with a band of two standard deviations`}
        data={data}
        x={{ label: 'time (UTC)', time: true }}
        y={unit === '-' ? 'value' : heading('value', unit)}
        series={[
          {
            label: component(chosen),
            stroke: kColours[0],
            width: 2,
            spanGaps: true,
            points: { show: true, size: 7, fill: kColours[0] },
          },
          { ...bound('plus two standard deviations'), spanGaps: true },
          { ...bound('minus two standard deviations'), spanGaps: true },
          ...(versions.every(wasUsed) ? [] : [kRejected]),
        ]}
        bands={[{ series: [2, 3], fill: kColours[0] + '22' }]}
        describe={describe}
      />
    </section>
  );
}
