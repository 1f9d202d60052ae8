// A histogram: the number of values in each of equal intervals.
import { useMemo } from 'preact/hooks';
import uPlot from 'uplot';
import { kColours, Plot } from './plot';

const kBins = 24;

interface Counted {
  label: string;
  values: number[];
}

// The first of `of` has all values; the others have some of them.
export function Histogram(props: { label: string; x: string; y: string; of: Counted[] }) {
  const { of } = props;
  const { data, low, high } = useMemo(() => {
    const all = of[0].values;
    const low = Math.min(...all);
    const width = (Math.max(...all) - low || 1) / kBins;
    const count = (values: number[]) => {
      const bins = new Array<number>(kBins).fill(0);
      for (const value of values) bins[Math.min(kBins - 1, Math.floor((value - low) / width))]++;
      return bins;
    };
    const centres = Array.from({ length: kBins }, (_, i) => low + (i + 0.5) * width);
    return {
      data: [centres, ...of.map(({ values }) => count(values))] as uPlot.AlignedData,
      low,
      high: low + kBins * width,
    };
  }, [of]);
  const bars = uPlot.paths.bars!({ size: [0.9, 60] });
  return (
    <Plot
      label={props.label}
      data={data}
      x={{ label: props.x, range: [low, high] }}
      y={props.y}
      series={of.map(({ label }, k) => ({
        label,
        fill: kColours[k] + (k === 0 && of.length > 1 ? '66' : ''),
        stroke: kColours[k],
        paths: bars,
        points: { show: false },
      }))}
    />
  );
}
