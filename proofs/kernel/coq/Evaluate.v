(** An executable reading of the specification: for rational parameter values and a rational schedule it decides the network,
    the separation of each mutex pair, and each obligation, and it is proved to decide what Spec.v says.

    States are tables; a trace holds the state after each happening.  Over-all conditions are about all real instants: between
    two neighbours among happenings, ends and zeros of comparisons nothing changes its truth, so one instant in between decides. *)

Require Import Reals QArith Qreals List Bool Lra Lia Arith.
Require Import Spec States.
Import ListNotations.
Arguments Q2R : simpl never. Arguments Qle_bool : simpl never. Arguments Qred : simpl never.
Arguments Qplus : simpl never. Arguments Qmult : simpl never. Arguments Qminus : simpl never.
Arguments Qdiv : simpl never.
Open Scope Q_scope.

Definition less (x y : Q) : bool := negb (Qle_bool y x).
Definition q_sum {A} (f : A -> Q) (l : list A) : Q := fold_right (fun x rest => Qred (f x + rest)) 0 l.
Definition pair_dec : forall x y : nat * nat, {x = y} + {x <> y}.
Proof. decide equality; apply Nat.eq_dec. Defined.

Section Evaluation.
Variable P : plan.
Variable values : list Q.   (* of the parameters *)
Variable times : list Q.    (* of the time points *)

Definition q_t (p : nat) : Q := nth p times 0.

Fixpoint q_ev (e : expr) : Q :=
  match e with
  | Num q => q
  | Param i => nth i values 0
  | Time p => q_t p
  | Plus a b => Qred (q_ev a + q_ev b)
  | Minus a b => Qred (q_ev a - q_ev b)
  | Scale q a => Qred (q * q_ev a)
  end.

(** ** States *)

Record q_state := { q_holds : nat -> bool; q_value : nat -> Q }.

Definition q_calculated (o : operation) (x y : Q) : Q :=
  Qred match o with Sum => x + y | Difference => x - y | Product => x * y | Quotient => x / y end.

Fixpoint q_amount (s : q_state) (x : term) : Q :=
  match x with
  | Linear e => q_ev e
  | Fluent f => q_value s f
  | Calculate o x y => q_calculated o (q_amount s x) (q_amount s y)
  end.

Definition q_above (strict : bool) (x : Q) : bool := if strict then less 0 x else Qle_bool 0 x.

Fixpoint q_sat (s : q_state) (c : cond) : bool :=
  match c with
  | Always => true
  | Atom a => q_holds s a
  | Not c => negb (q_sat s c)
  | And c d => q_sat s c && q_sat s d
  | Or c d => q_sat s c || q_sat s d
  | Compare strict x => q_above strict (q_amount s x)
  end.

(** As tables of the atoms and fluents that can change. *)
Definition above_all (f : change -> option nat) (l : list nat) : nat :=
  fold_right (fun w m => match f (makes w) with Some n => Nat.max (S n) m | None => m end)
    (fold_right (fun n m => Nat.max (S n) m) 0%nat l) (effects P).

Definition atoms : nat := above_all (fun c => match c with Add a | Del a => Some a | _ => None end) [].
Definition fluents : nat :=
  above_all (fun c => match c with Increase f _ | Assign f _ => Some f | _ => None end) (map flows_to (flows P)).

Definition tabled (s : q_state) : q_state :=
  let holding := map (q_holds s) (seq 0 atoms) in
  let valued := map (q_value s) (seq 0 fluents) in
  {| q_holds := fun a => match nth_error holding a with Some b => b | None => q_holds s a end;
     q_value := fun f => match nth_error valued f with Some x => x | None => q_value s f end |}.

Definition q_initially : q_state :=
  {| q_holds := fun a => existsb (Nat.eqb a) (true_at_first P); q_value := fun f => q_ev (value_at_first P f) |}.

Definition q_fires (s : q_state) (time : Q) (w : effect) : bool := Qeq_bool (q_t (point w)) time && q_sat s (guard w).

Definition q_assigned (s : q_state) (f : nat) (old : Q) (w : effect) : Q :=
  match makes w with Assign h x => if Nat.eqb h f then q_amount s x else old | _ => old end.

Definition q_increased (s : q_state) (f : nat) (w : effect) : Q :=
  match makes w with Increase h x => if Nat.eqb h f then q_amount s x else 0 | _ => 0 end.

Definition q_updated (time : Q) (s : q_state) : q_state :=
  let fired := filter (q_fires s time) (effects P) in
  {| q_holds := fun a => existsb (adds a) fired || q_holds s a && negb (existsb (deletes a) fired);
     q_value := fun f => Qred (fold_left (q_assigned s f) fired (q_value s f) + q_sum (q_increased s f) fired) |}.

(** How fast a continuous effect changes a fluent right after a time. *)
Definition q_slope (from : Q) (f : nat) (k : flow) : Q :=
  if Nat.eqb (flows_to k) f && Qle_bool (q_t (starts k)) from && less from (q_t (ends k))
  then q_amount q_initially (rate k) else 0.

(** How fast the value of an expression changes then, if it is linear in what continuous effects change. *)
Fixpoint q_grade (from : Q) (s : q_state) (x : term) : Q :=
  match x with
  | Linear _ => 0
  | Fluent f => q_sum (q_slope from f) (flows P)
  | Calculate o x y =>
      let m := q_grade from s x in
      let n := q_grade from s y in
      match o with
      | Sum => m + n
      | Difference => m - n
      | Product => m * q_amount s y + q_amount s x * n
      | Quotient => m / q_amount s y
      end
  end.

Fixpoint flat (x : term) : bool :=
  match x with
  | Linear _ => true
  | Fluent f => negb (existsb (fun k => Nat.eqb (flows_to k) f) (flows P))
  | Calculate _ x y => flat x && flat y
  end.

Fixpoint straight (x : term) : bool :=
  match x with
  | Linear _ | Fluent _ => true
  | Calculate Product x y => straight x && straight y && (flat x || flat y)
  | Calculate Quotient x y => straight x && straight y && flat y
  | Calculate _ x y => straight x && straight y
  end.

(** Until the next happening, or before. *)
Definition q_drifted (from until : Q) (s : q_state) : q_state :=
  {| q_holds := q_holds s; q_value := fun f => Qred (q_value s f + (until - from) * q_sum (q_slope from f) (flows P)) |}.

(** ** The trace *)

Fixpoint put_up (x : Q) (l : list Q) : list Q :=
  match l with [] => [x] | y :: rest => if less x y then x :: l else if less y x then y :: put_up x rest else l end.

Definition moments_up : list Q := fold_right (fun p => put_up (q_t p)) [] (happenings P).

Definition state_since (found : option (Q * q_state)) (time : Q) : q_state :=
  match found with Some (x, s) => q_drifted x time s | None => q_initially end.

Fixpoint trace_from (found : option (Q * q_state)) (l : list Q) : list (Q * q_state) :=
  match l with
  | [] => []
  | x :: rest =>
      let after := tabled (q_updated x (tabled (state_since found x))) in (x, after) :: trace_from (Some (x, after)) rest
  end.

Fixpoint last_before (time : Q) (found : option (Q * q_state)) (l : list (Q * q_state)) : option (Q * q_state) :=
  match l with
  | [] => found
  | (x, s) :: rest => if less x time then last_before time (Some (x, s)) rest else found
  end.

Section Traced.
Variable trace : list (Q * q_state).

Definition q_before (time : Q) : q_state := state_since (last_before time None trace) time.
Definition q_after (time : Q) : q_state := q_updated time (q_before time).

(** ** Obligations *)

(** Where a comparison would be zero, if it went on as it does right after a time. *)
Definition crossing (x : Q) (s : q_state) (e : term) : Q := Qred (x - q_amount s e / q_grade x s e).

Definition crossings (c : cond) (x : Q) : list Q :=
  match comparisons c with [] => [] | l => let s := q_after x in map (crossing x s) l end.

Definition next (r e : Q) (l : list Q) : Q := fold_right (fun y m => if less r y && less y m then y else m) e l.

Definition instants (s e : Q) (c : cond) : list Q :=
  let inner := filter (fun x => less s x && less x e) (moments_up ++ flat_map (crossings c) (s :: moments_up)) in
  inner ++ map (fun r => Qred ((r + next r e inner) / 2)) (s :: inner).

Definition q_met (d : duty) : bool :=
  match d with
  | AtPoint p c => q_sat (q_before (q_t p)) c
  | OverAll s e c =>
      if less (q_t s) (q_t e) then
        forallb (fun time => q_sat (q_before time) c && q_sat (q_after time) c) (instants (q_t s) (q_t e) c)
      else true
  | Goal c => q_sat (q_after (last moments_up 0)) c
  end.

End Traced.

Definition q_kept (e : nat * nat * expr) : bool :=
  match e with (a, b, w) => Qle_bool (q_ev w) (q_t b - q_t a) end.

Definition q_apart (epsilon : Q) (pq : nat * nat) : bool :=
  let gap := q_t (fst pq) - q_t (snd pq) in
  (Qle_bool epsilon gap || Qle_bool epsilon (- gap)) && negb (Qeq_bool (q_t (fst pq)) (q_t (snd pq))).

(** What is true throughout is looked at as if all comparisons were linear between happenings. *)
Definition linear_duty (d : duty) : bool :=
  match d with OverAll _ _ c => forallb straight (comparisons c) | _ => true end.

(** What is said of a schedule: whether all of it is right, rates do not change, time 0 is 0, each edge is kept, each mutex pair is apart, each obligation is met. *)
Record reading := {
  is_right : bool;
  is_steady : bool;
  at_zero : bool;
  edges_kept : list bool;
  mutex_pairs : list (nat * nat);
  pairs_apart : list bool;
  duties_met : list bool;
  effects_agree : list bool
}.

Definition evaluated (epsilon : Q) : reading :=
  let trace := trace_from None moments_up in
  let close := nodup pair_dec (mutex P) in
  {| is_right := forallb linear_duty (duties P);
     is_steady := steady P;
     at_zero := Qeq_bool (q_t 0) 0;
     edges_kept := map q_kept (edges P);
     mutex_pairs := close;
     pairs_apart := map (q_apart epsilon) close;
     duties_met := map (q_met trace) (duties P);
     effects_agree := map (q_met trace) (agreements (effects P)) |}.

(** ** It says what the specification says *)

Open Scope R_scope.

Let g (i : nat) : R := Q2R (nth i values 0%Q).
Let t (p : nat) : R := Q2R (q_t p).

Lemma less_R x y : less x y = true <-> Q2R x < Q2R y.
Proof. unfold less. rewrite negb_true_iff, <- not_true_iff_false, Qle_R. lra. Qed.

Lemma less_false x y : less x y = false <-> Q2R y <= Q2R x.
Proof. rewrite <- not_true_iff_false, less_R. lra. Qed.

Lemma q_sum_R {A} (f : A -> Q) (h : A -> R) l : (forall x, Q2R (f x) = h x) -> Q2R (q_sum f l) = sum h l.
Proof. intros E. induction l as [|x l IH]; simpl; [apply zero_R|]. now rewrite Q2R_red, Q2R_plus, E, IH. Qed.

Lemma q_ev_R e : Q2R (q_ev e) = ev g t e.
Proof. induction e; simpl; auto; rewrite ?Q2R_red, ?Q2R_plus, ?Q2R_minus, ?Q2R_mult; congruence. Qed.

(** A table and a state that are the same. *)
Definition alike (q : q_state) (s : state) : Prop :=
  (forall a, q_holds q a = holds s a) /\ (forall f, Q2R (q_value q f) = value s f).

Lemma alike_same q s s' : alike q s -> same s s' -> alike q s'.
Proof. intros [A V] [B W]. split; intros; [now rewrite A | now rewrite V]. Qed.

Lemma nth_tabled {A} (f : nat -> A) n k : match nth_error (map f (seq 0 n)) k with Some x => x | None => f k end = f k.
Proof.
  destruct (nth_error _ k) eqn:E; auto. destruct (Nat.lt_ge_cases k n) as [L|L].
  - rewrite (nth_error_nth' _ (f 0%nat)) in E by now rewrite map_length, seq_length.
    rewrite map_nth, seq_nth in E by auto. now inversion E.
  - assert (K : nth_error (map f (seq 0 n)) k <> None) by congruence.
    apply nth_error_Some in K. rewrite map_length, seq_length in K. lia.
Qed.

Lemma alike_tabled q s : alike q s -> alike (tabled q) s.
Proof.
  intros [A V]. split; intros x; unfold tabled; cbn [q_holds q_value].
  - now rewrite (nth_tabled (q_holds q)).
  - now rewrite (nth_tabled (q_value q)).
Qed.

Lemma q_amount_R q s e : alike q s -> Q2R (q_amount q e) = amount g t s e.
Proof.
  intros [_ V]. induction e as [e | f | o x IHx y IHy]; simpl; [apply q_ev_R | apply V |].
  unfold q_calculated. rewrite Q2R_red, <- IHx, <- IHy.
  destruct o; [apply Q2R_plus | apply Q2R_minus | apply Q2R_mult | apply Q2R_quotient].
Qed.

Lemma q_above_R strict x : q_above strict x = true <-> above strict (Q2R x).
Proof. destruct strict; simpl; [rewrite less_R | rewrite Qle_R]; rewrite zero_R; reflexivity. Qed.

Lemma q_sat_R q s c : alike q s -> q_sat q c = sat g t s c.
Proof.
  intros S. induction c; simpl; try congruence; [apply S|].
  apply iff_bool. rewrite q_above_R, (q_amount_R q s) by auto. destruct above_dec; split; easy.
Qed.

Lemma alike_initially : alike q_initially (initially P g t).
Proof. split; intros; simpl; auto. apply q_ev_R. Qed.

Lemma alike_updated q s time : alike q s -> alike (q_updated time q) (updated P g t (Q2R time) s).
Proof.
  intros S. unfold q_updated, updated.
  assert (F : filter (q_fires q time) (effects P) = filter (fires g t s (Q2R time)) (effects P)).
  { apply filter_ext. intros w. unfold q_fires, fires. rewrite (q_sat_R q s) by auto. unfold t.
    destruct (Qeq_bool (q_t (point w)) time) eqn:E; destruct Req_EM_T as [N|N]; auto.
    - apply Qeq_R in E. easy.
    - apply Qeq_R in N. congruence. }
  rewrite F. clear F. set (l := filter _ _). clearbody l. split; simpl.
  - intros a. destruct S as [A _]. now rewrite A.
  - intros f. rewrite Q2R_red, Q2R_plus. f_equal.
    + assert (V : Q2R (q_value q f) = value s f) by apply S. revert V. generalize (q_value q f), (value s f).
      induction l as [|w l IH]; simpl; intros x y E; auto. apply IH.
      unfold q_assigned, assigned. destruct (makes w); auto. destruct Nat.eqb; auto. now apply q_amount_R.
    + apply q_sum_R. intros w. unfold q_increased, increased. destruct (makes w); auto using zero_R.
      destruct Nat.eqb; auto using zero_R. now apply q_amount_R.
Qed.

(** Without a happening in between, continuous effects act as they do right after the first of two times. *)
Lemma q_slope_R from until f : Q2R from < until -> (forall p, In p (happenings P) -> ~ Q2R from < t p < until) ->
  Q2R (q_sum (q_slope from f) (flows P)) = sum (slope P g t (Q2R from) until f) (flows P).
Proof.
  intros L N. assert (H : forall k, In k (flows P) -> Q2R (q_slope from f k) = slope P g t (Q2R from) until f k).
  { intros k I. pose proof (N _ (start_happens _ _ I)). pose proof (N _ (end_happens _ _ I)). unfold q_slope, slope.
    destruct Nat.eqb; simpl; [|apply zero_R]. unfold t in *.
    destruct (Qle_bool _ from) eqn:A; destruct Rle_dec as [B|B]; simpl; try apply zero_R.
    - destruct (less from _) eqn:C; destruct Rle_dec as [D|D]; auto using zero_R, q_amount_R, alike_initially.
      + apply less_R in C. lra.
      + apply less_false in C. lra.
    - apply Qle_R in A. easy.
    - apply Qle_R in B. congruence. }
  induction (flows P) as [|k l IH]; simpl; [apply zero_R|].
  rewrite Q2R_red, Q2R_plus, IH, H; auto; intros; try (apply H; now right); now left.
Qed.

Lemma alike_drifted q s from until : alike q s -> Q2R from < Q2R until ->
  (forall p, In p (happenings P) -> ~ Q2R from < t p < Q2R until) ->
  alike (q_drifted from until q) (drifted P g t (Q2R from) (Q2R until) s).
Proof.
  intros [A V] L N. split; simpl; auto. intros f.
  rewrite Q2R_red, Q2R_plus, Q2R_mult, Q2R_minus, V, (q_slope_R from (Q2R until)); auto.
Qed.

Fixpoint ascending (l : list Q) : Prop :=
  match l with [] => True | x :: rest => (forall y, In y rest -> Q2R x < Q2R y) /\ ascending rest end.

Lemma put_up_in x l y : In y (put_up x l) -> y = x \/ In y l.
Proof.
  induction l as [|z l IH]; simpl; [intuition|]. destruct (less x z); [simpl; intuition|].
  destruct (less z x); simpl; intuition.
Qed.

Lemma in_put_up x l : (exists y, In y (put_up x l) /\ Q2R y = Q2R x) /\ forall y, In y l -> In y (put_up x l).
Proof.
  induction l as [|z l [[y [I E]] M]]; simpl; [split; eauto; easy|]. destruct (less x z) eqn:A.
  - split; [exists x|]; simpl; auto.
  - destruct (less z x) eqn:B; simpl.
    + split; [now exists y; auto|]. intros w [->|J]; auto.
    + apply less_false in A, B. split; [exists z; split; auto; lra | auto].
Qed.

Lemma put_up_ascends x l : ascending l -> ascending (put_up x l).
Proof.
  induction l as [|z l IH]; simpl; [easy|]. intros [A D]. destruct (less x z) eqn:X.
  - apply less_R in X. simpl. split; [|now split]. intros y [<-|I]; auto. apply A in I. lra.
  - destruct (less z x) eqn:Y; simpl; [|now split]. apply less_R in Y. split; auto.
    intros y I. apply put_up_in in I as [->|I]; auto.
Qed.

Lemma moments_ascend : ascending moments_up.
Proof. unfold moments_up. induction (happenings P); simpl; [easy|]. now apply put_up_ascends. Qed.

Lemma moments_happen y : In y moments_up -> exists p, In p (happenings P) /\ t p = Q2R y.
Proof.
  unfold moments_up. induction (happenings P) as [|p l IH]; simpl; [easy|]. intros I. apply put_up_in in I as [->|I].
  - exists p. split; auto.
  - destruct (IH I) as [q [J E]]. exists q. auto.
Qed.

Lemma happens_at p : In p (happenings P) -> exists y, In y moments_up /\ Q2R y = t p.
Proof.
  unfold moments_up. induction (happenings P) as [|q l IH]; simpl; [easy|]. intros [->|I].
  - apply (in_put_up (q_t p)).
  - destruct (IH I) as [y [J E]]. exists y. split; auto. now apply (in_put_up (q_t q)).
Qed.

(** *** The trace follows every course *)

Variable before after : R -> state.
Hypothesis C : course P g t before after.

(** What has been found is the state after the last happening so far; the others are still to come. *)
Definition so_far (found : option (Q * q_state)) (l : list Q) : Prop :=
  ascending l /\
  match found with
  | None => forall p, In p (happenings P) -> exists y, In y l /\ Q2R y = t p
  | Some (x, s) => alike s (after (Q2R x)) /\ (forall y, In y l -> Q2R x < Q2R y) /\
      forall p, In p (happenings P) -> t p <= Q2R x \/ exists y, In y l /\ Q2R y = t p
  end.

Definition is_past (found : option (Q * q_state)) (time : Q) : Prop :=
  match found with None => True | Some (x, _) => Q2R x < Q2R time end.

Lemma state_since_alike found l time : so_far found l -> is_past found time -> (forall y, In y l -> Q2R time <= Q2R y) ->
  alike (state_since found time) (before (Q2R time)).
Proof.
  intros [_ F] O L. destruct found as [[x s]|]; simpl in *.
  - destruct F as [S [_ H]]. assert (N : forall p, In p (happenings P) -> ~ Q2R x < t p < Q2R time).
    { intros p I [A B]. destruct (H _ I) as [D|[y [J E]]]; [lra|]. apply L in J. lra. }
    eapply alike_same; [apply alike_drifted; eauto|]. apply same_sym. now apply (between _ _ _ _ _ C).
  - eapply alike_same; [apply alike_initially|]. apply same_sym. apply (at_first _ _ _ _ _ C).
    intros p I. destruct (F _ I) as [y [J <-]]. auto.
Qed.

Lemma so_far_next found x l : so_far found (x :: l) ->
  so_far (Some (x, tabled (q_updated x (tabled (state_since found x))))) l.
Proof.
  intros F. assert (S : alike (state_since found x) (before (Q2R x))).
  { apply (state_since_alike found (x :: l)); auto.
    - destruct F as [_ F]. destruct found as [[y s]|]; simpl in *; auto. apply F. now left.
    - intros y [<-|I]; [lra|]. apply Rlt_le. now apply F. }
  destruct F as [[A D] F]. split; auto. split; [|split; auto].
  - apply alike_tabled. eapply alike_same; [apply alike_updated, alike_tabled; eauto|].
    apply same_sym, (at_times _ _ _ _ _ C).
  - intros p I. destruct found as [[y s]|]; simpl in *.
    + destruct F as [_ [B H]]. pose proof (B x (or_introl eq_refl)).
      destruct (H _ I) as [L|[z [[<-|J] E]]]; [left; lra | left; lra | right; eauto].
    + destruct (F _ I) as [z [[<-|J] E]]; [left; lra | right; eauto].
Qed.

Lemma last_before_alike time : forall l found, so_far found l -> is_past found time ->
  alike (state_since (last_before time found (trace_from found l)) time) (before (Q2R time)).
Proof.
  induction l as [|x l IH]; intros found F O.
  - apply (state_since_alike found []); auto. easy.
  - cbn [trace_from last_before]. destruct (less x time) eqn:L.
    + apply less_R in L. apply IH; [now apply so_far_next | exact L].
    + apply less_false in L. apply (state_since_alike found (x :: l)); auto. intros y [<-|I]; auto. apply F in I. lra.
Qed.

Let trace := trace_from None moments_up.

Lemma before_alike time : alike (q_before trace time) (before (Q2R time)).
Proof. apply last_before_alike; simpl; auto. split; [apply moments_ascend | apply happens_at]. Qed.

Lemma after_alike time : alike (q_after trace time) (after (Q2R time)).
Proof. eapply alike_same; [apply alike_updated, before_alike|]. apply same_sym, (at_times _ _ _ _ _ C). Qed.

Lemma sat_before time c : q_sat (q_before trace time) c = sat g t (before (Q2R time)) c.
Proof. apply q_sat_R, before_alike. Qed.

Lemma sat_after time c : q_sat (q_after trace time) c = sat g t (after (Q2R time)) c.
Proof. apply q_sat_R, after_alike. Qed.

(** *** Over-all conditions *)

Lemma after_idle time c : (forall p, In p (happenings P) -> t p <> time) ->
  sat g t (after time) c = sat g t (before time) c.
Proof. intros N. apply sat_same. eapply same_trans; [apply (at_times _ _ _ _ _ C)|]. now apply updated_idle. Qed.

(** A linear function without a zero in an open interval is on one side of zero there. *)
Lemma one_side strict a m x r1 r2 u w : (m <> 0 -> ~ r1 < x - a / m < r2) -> r1 < u < r2 -> r1 < w < r2 ->
  above strict (a + (u - x) * m) -> above strict (a + (w - x) * m).
Proof.
  intros N U W. destruct (Req_dec m 0) as [Z|Z].
  - subst. destruct strict; simpl; lra.
  - specialize (N Z). set (r := x - a / m) in *. assert (E : a = m * (x - r)) by (unfold r; field; auto).
    rewrite E. replace (m * (x - r) + (u - x) * m) with (m * (u - r)) by ring.
    replace (m * (x - r) + (w - x) * m) with (m * (w - r)) by ring.
    assert (H : r <= r1 \/ r2 <= r) by lra. clear E N. clearbody r.
    destruct (Rlt_dec 0 m) as [M|M]; destruct H, strict; simpl; intros A; nra.
Qed.

Section Segment.
Variable x : Q.
Variable r1 r2 : R.
Hypothesis X : Q2R x <= r1.
Hypothesis N : forall p, In p (happenings P) -> ~ Q2R x < t p < r2.

Lemma drifting u : r1 < u < r2 -> same (before u) (drifted P g t (Q2R x) u (after (Q2R x))).
Proof. intros U. apply (between _ _ _ _ _ C); [lra|]. intros p I H. apply (N p I). lra. Qed.

Lemma flat_grade s e : flat e = true -> Q2R (q_grade x s e) = 0.
Proof.
  induction e as [e | f | o y IHy z IHz]; simpl; [intros _; apply zero_R | |].
  - induction (flows P) as [|k l IH]; simpl; [intros _; apply zero_R|]. intros F. apply negb_true_iff, orb_false_iff in F as [K F].
    rewrite Q2R_red, Q2R_plus, IH by now rewrite F. unfold q_slope. rewrite K. simpl. rewrite zero_R. lra.
  - rewrite andb_true_iff. intros [Y Z]. specialize (IHy Y). specialize (IHz Z).
    destruct o; rewrite ?Q2R_plus, ?Q2R_minus, ?Q2R_quotient, ?Q2R_mult, ?IHy, ?IHz; unfold Rdiv; lra.
Qed.

Lemma amount_drifting u e : straight e = true -> r1 < u < r2 ->
  amount g t (before u) e = Q2R (q_amount (q_after trace x) e) + (u - Q2R x) * Q2R (q_grade x (q_after trace x) e).
Proof.
  intros E U. rewrite (amount_same _ _ _ _ _ (drifting u U)). destruct (after_alike x) as [_ V]. revert E.
  set (s := q_after trace x) in *. clearbody s. induction e as [e | f | o y IHy z IHz]; simpl.
  - intros _. rewrite q_ev_R, zero_R. ring.
  - intros _. rewrite V, (q_slope_R x u); [reflexivity | lra | intros p I H; apply (N p I); lra].
  - unfold q_calculated. rewrite Q2R_red. destruct o; rewrite !andb_true_iff; intros E; cbn [calculated].
    + rewrite IHy, IHz, !Q2R_plus by tauto. ring.
    + rewrite IHy, IHz, !Q2R_minus by tauto. ring.
    + destruct E as [[Y Z] F]. rewrite IHy, IHz, Q2R_plus, !Q2R_mult by auto.
      apply orb_true_iff in F as [F|F]; rewrite (flat_grade s _ F); ring.
    + destruct E as [[Y Z] F]. rewrite IHy, IHz, !Q2R_quotient, (flat_grade s _ F) by auto. unfold Rdiv.
      rewrite Rmult_0_r, Rplus_0_r. ring.
Qed.

Lemma unchanging c u w : forallb straight (comparisons c) = true -> (forall k, In k (comparisons c) -> ~ r1 < Q2R (crossing x (q_after trace x) k) < r2) ->
  r1 < u < r2 -> r1 < w < r2 -> sat g t (before u) c = sat g t (before w) c.
Proof.
  intros L K U W. induction c as [| a | c IH | c IHc d IHd | c IHc d IHd | strict e]; simpl in *;
  rewrite ?forallb_app, ?andb_true_iff in L; auto.
  - destruct (drifting u U) as [A _], (drifting w W) as [B _]. now rewrite A, B.
  - now rewrite IH.
  - rewrite IHc, IHd; try tauto; intros k I; apply K, in_app_iff; auto.
  - rewrite IHc, IHd; try tauto; intros k I; apply K, in_app_iff; auto.
  - assert (S : forall u w, r1 < u < r2 -> r1 < w < r2 ->
      above strict (amount g t (before u) e) -> above strict (amount g t (before w) e)).
    { intros v y V Y. rewrite !amount_drifting by tauto. apply (one_side _ _ _ _ r1 r2); auto.
      intros _. specialize (K e (or_introl eq_refl)). unfold crossing in K.
      now rewrite Q2R_red, Q2R_minus, Q2R_quotient in K. }
    pose proof (S u w U W). pose proof (S w u W U). repeat destruct above_dec; tauto.
Qed.

End Segment.

Lemma greatest (s : Q) l u : Q2R s <= u -> exists x, In x (s :: l) /\ Q2R x <= u /\
  forall y, In y (s :: l) -> Q2R y <= u -> Q2R y <= Q2R x.
Proof.
  intros S. induction l as [|z l [x [I [L M]]]].
  - exists s. split; [now left|]. split; auto. intros y [<-|[]]. lra.
  - destruct (Rle_dec (Q2R z) u) as [Z|Z]; [destruct (Rle_dec (Q2R z) (Q2R x)) as [Y|Y]|].
    + exists x. simpl in *. split; [intuition|]. split; auto. intros y [<-|[<-|J]] B; auto; apply M; auto.
    + exists z. simpl in *. split; auto. split; auto. intros y [<-|[<-|J]] B.
      * apply Rle_trans with (Q2R x); [auto | lra].
      * lra.
      * apply Rle_trans with (Q2R x); [auto | lra].
    + exists x. simpl in *. split; [intuition|]. split; auto. intros y [<-|[<-|J]] B; auto. easy.
Qed.

Lemma next_after r e l : Q2R r < Q2R e ->
  Q2R r < Q2R (next r e l) <= Q2R e /\ (forall y, In y l -> Q2R r < Q2R y -> Q2R (next r e l) <= Q2R y) /\
  (next r e l = e \/ In (next r e l) l).
Proof.
  intros E. unfold next. induction l as [|z l [B [M I]]]; simpl; [split; [lra|]; split; auto; easy|].
  set (n := fold_right _ e l) in *. destruct (less r z && less z n) eqn:L.
  - apply andb_true_iff in L as [L1 L2]. apply less_R in L1, L2. split; [lra|]. split; [|auto].
    intros y [<-|J] D; [lra|]. specialize (M _ J D). lra.
  - split; auto. split; [|tauto]. intros y [<-|J] D; auto. apply andb_false_iff in L as [L|L]; apply less_false in L; lra.
Qed.

Lemma half_R a b : Q2R (Qred ((a + b) / 2)) = (Q2R a + Q2R b) / 2.
Proof. rewrite Q2R_red, Q2R_div, Q2R_plus; [|easy]. replace (Q2R 2) with 2; [reflexivity|]. unfold Q2R. simpl. lra. Qed.

Lemma over_all_right s e c : forallb straight (comparisons c) = true -> Q2R s < Q2R e ->
  forallb (fun u => q_sat (q_before trace u) c && q_sat (q_after trace u) c) (instants trace s e c) = true <->
  forall u, Q2R s < u < Q2R e -> sat g t (before u) c = true /\ sat g t (after u) c = true.
Proof.
  intros Lin L. unfold instants. set (all := moments_up ++ flat_map (crossings trace c) (s :: moments_up)).
  set (inner := filter (fun x => less s x && less x e) all).
  assert (I : forall y, In y inner <-> In y all /\ Q2R s < Q2R y < Q2R e).
  { intros y. unfold inner. rewrite filter_In, andb_true_iff, !less_R. reflexivity. }
  rewrite forallb_forall. split.
  - intros H u U. assert (T : forall y, In y (inner ++ map (fun r => Qred ((r + next r e inner) / 2)) (s :: inner)) ->
      sat g t (before (Q2R y)) c = true /\ sat g t (after (Q2R y)) c = true).
    { intros y J. apply H, andb_true_iff in J as [A B]. now rewrite <- sat_before, <- sat_after. }
    destruct (greatest s inner u) as [r [RI [RU RM]]]; [lra|]. destruct (Req_dec (Q2R r) u) as [E|E].
    { destruct RI as [<-|RI]; [lra|]. rewrite <- E. apply T, in_app_iff. now left. }
    assert (RE : Q2R r < Q2R e) by lra. destruct (next_after r e inner RE) as [N1 [N2 N3]].
    set (n := next r e inner) in *. assert (UN : u < Q2R n).
    { apply Rnot_le_lt. intros B. destruct N3 as [N3|N3]; [rewrite N3 in B; lra|].
      pose proof (RM n (or_intror N3) B). lra. }
    assert (F : forall y, In y all -> ~ Q2R r < Q2R y < Q2R n).
    { intros y J [A B]. assert (SR : Q2R s <= Q2R r) by (apply RM; [now left | lra]).
      assert (K : In y inner) by (apply I; split; auto; lra). pose proof (N2 _ K A). lra. }
    destruct (greatest s moments_up (Q2R r)) as [x [XI [XR XM]]]; [apply RM; [now left | lra]|].
    assert (NO : forall p, In p (happenings P) -> ~ Q2R x < t p < Q2R n).
    { intros p J [A B]. destruct (happens_at p J) as [y [K Y]]. rewrite <- Y in A, B.
      destruct (Rle_dec (Q2R y) (Q2R r)) as [D|D]; [pose proof (XM y (or_intror K) D); lra|].
      apply (F y); [apply in_app_iff; now left | lra]. }
    assert (K : forall k, In k (comparisons c) -> ~ Q2R r < Q2R (crossing x (q_after trace x) k) < Q2R n).
    { intros k J. apply F, in_app_iff. right. apply in_flat_map. exists x. split; auto. unfold crossings.
      destruct (comparisons c) as [|k' l] eqn:Z; [easy|]. now apply in_map. }
    set (m := Qred ((r + n) / 2)) in *. assert (M : Q2R r < Q2R m < Q2R n) by (unfold m; rewrite half_R; lra).
    assert (B : sat g t (before u) c = true).
    { rewrite (unchanging x (Q2R r) (Q2R n) XR NO c u (Q2R m)); auto; [|lra]. apply T, in_app_iff. right.
      apply in_map_iff. exists r. split; auto. }
    split; auto. rewrite after_idle; auto. intros p J E'. destruct (happens_at p J) as [y [J' Y]].
    apply (F y); [apply in_app_iff; now left | lra].
  - intros H y J. rewrite sat_before, sat_after. apply andb_true_iff, H. apply in_app_iff in J as [J|J]; [now apply I|].
    apply in_map_iff in J as [r [<- J]].
    assert (R1 : Q2R s <= Q2R r < Q2R e) by (destruct J as [<-|J]; [lra | apply I in J; lra]).
    destruct (next_after r e inner (proj2 R1)) as [N1 _]. rewrite half_R. lra.
Qed.

(** *** The goal *)

Let final : Q := last moments_up 0%Q.

Lemma last_of (l : list Q) : forall y, ascending l -> In y l -> Q2R y <= Q2R (last l 0%Q) /\ In (last l 0%Q) l.
Proof.
  induction l as [|x l IH]; [easy|]. intros y [A D] I. destruct l as [|z l].
  - destruct I as [<-|[]]. simpl. split; [lra | auto].
  - assert (K : In (last (z :: l) 0%Q) (z :: l)) by (apply (IH z D); now left).
    change (last (x :: z :: l) 0%Q) with (last (z :: l) 0%Q). split; [|now right].
    destruct I as [<-|I]; [apply Rlt_le; now apply A | now apply IH].
Qed.

Lemma goal_right c : q_sat (q_after trace final) c = true <->
  forall u, (forall p, In p (happenings P) -> t p <= u) -> sat g t (after u) c = true.
Proof.
  rewrite sat_after.
  assert (L : forall p, In p (happenings P) -> t p <= Q2R final /\ exists q, In q (happenings P) /\ t q = Q2R final).
  { intros p I. destruct (happens_at p I) as [y [J <-]]. destruct (last_of moments_up y moments_ascend J) as [A B].
    split; auto. now apply moments_happen. }
  split; [|intros H; apply H; intros p I; now apply L]. intros H u U. rewrite <- H. clear H.
  destruct (happenings P) as [|p l] eqn:E.
  - assert (S : forall v, same (after v) (initially P g t)).
    { intros v. eapply same_trans; [apply (at_times _ _ _ _ _ C)|].
      eapply same_trans; [apply updated_idle; rewrite E; easy|]. apply (at_first _ _ _ _ _ C). rewrite E. easy. }
    apply sat_same. eapply same_trans; [apply S|]. apply same_sym, S.
  - rewrite <- E in L, U. destruct (L p) as [_ [q [I Q]]]; [rewrite E; now left|].
    assert (F : Q2R final <= u) by (rewrite <- Q; now apply U).
    destruct (Req_dec (Q2R final) u) as [Z|Z]; [now rewrite Z|]. assert (F' : Q2R final < u) by lra.
    rewrite after_idle by (intros x J; destruct (L x J) as [A _]; lra).
    apply sat_same. eapply same_trans; [apply (between _ _ _ _ _ C _ _ F')|].
    + intros x J. destruct (L x J) as [A _]. lra.
    + split; simpl; auto. intros f. rewrite sum_zero; [ring|]. intros k K. unfold slope. destruct Nat.eqb; auto.
      destruct Rle_dec; auto. destruct Rle_dec as [A|A]; auto. destruct (L _ (end_happens _ _ K)) as [B _]. lra.
Qed.

Lemma met_right d : linear_duty d = true -> (q_met trace d = true <-> met P g t before after d).
Proof.
  destruct d as [p c | s e c | c]; simpl; intros Lin.
  - rewrite sat_before. reflexivity.
  - unfold t. destruct (less (q_t s) (q_t e)) eqn:L.
    + apply less_R in L. now apply over_all_right.
    + apply less_false in L. split; auto. intros _ u U. lra.
  - apply goal_right.
Qed.

End Evaluation.

(** Each verdict of an evaluation is that of the specification, and so are both verdicts on the whole. *)
Lemma verdicts {A} (f : A -> bool) (means : A -> Prop) l : (forall x, In x l -> (f x = true <-> means x)) ->
  Forall2 (fun b x => b = true <-> means x) (map f l) l.
Proof. induction l; simpl; intros H; constructor; auto. Qed.

Lemma all_verdicts {A} (verdict : list bool) (means : A -> Prop) l : Forall2 (fun b x => b = true <-> means x) verdict l ->
  (forallb (fun b => b) verdict = true <-> forall x, In x l -> means x).
Proof.
  induction 1 as [|b x bs l E F IH]; simpl; [easy|]. rewrite andb_true_iff, IH, E. split.
  - intros [B M] y [<-|I]; auto.
  - intros M. split; auto.
Qed.

Definition is_allowed (r : reading) : bool := at_zero r && forallb (fun b => b) (edges_kept r).
Definition is_valid (r : reading) : bool :=
  is_steady r && forallb (fun b => b) (pairs_apart r) && forallb (fun b => b) (duties_met r) && forallb (fun b => b) (effects_agree r).

Section Right.
Variable P : plan.
Variable epsilon : Q.
Variable values times : list Q.
Open Scope R_scope.
Let g (i : nat) : R := Q2R (nth i values 0%Q).
Let t (p : nat) : R := Q2R (nth p times 0%Q).
Let r := evaluated P values times epsilon.

Theorem edges_right : Forall2 (fun b '(x, y, w) => b = true <-> ev g t w <= t y - t x) (edges_kept r) (edges P).
Proof.
  simpl. induction (edges P) as [|[[x y] w] l IH]; simpl; constructor; auto.
  rewrite Qle_R, Q2R_minus, q_ev_R. reflexivity.
Qed.

Let close := nodup pair_dec (mutex P).

Theorem pairs_right : mutex_pairs r = close /\
  Forall2 (fun b '(p, q) => b = true <-> apart epsilon t p q) (pairs_apart r) close.
Proof.
  split; [reflexivity|]. simpl. fold close. induction close as [|[p q] l IH]; simpl; constructor; auto.
  unfold q_apart, apart. cbn [fst snd]. rewrite andb_true_iff, orb_true_iff, negb_true_iff, <- not_true_iff_false.
  rewrite !Qle_R, Qeq_R, Q2R_opp, Q2R_minus. unfold q_t. fold (t p) (t q).
  unfold Rabs. destruct (Rcase_abs (t p - t q)); split; intros [A B]; (split; [lra | exact B]).
Qed.

Hypothesis Sure : is_right r = true.

Theorem duties_right before after : course P g t before after ->
  Forall2 (fun b d => b = true <-> met P g t before after d) (duties_met r) (duties P) /\
  Forall2 (fun b d => b = true <-> met P g t before after d) (effects_agree r) (agreements (effects P)).
Proof.
  intros C. simpl in Sure. rewrite forallb_forall in Sure. split; apply verdicts; intros d I; apply met_right; auto.
  clear Sure r. induction (effects P) as [|v l IH]; [easy|]. simpl in I. apply in_app_iff in I as [I|I]; [|auto].
  now apply in_map_iff in I as [w [<- _]].
Qed.

Theorem allowed_right : is_allowed r = true <-> kept P g t.
Proof.
  unfold is_allowed, kept. rewrite andb_true_iff.
  rewrite (all_verdicts _ (fun e => match e with (x, y, w) => ev g t w <= t y - t x end) (edges P)).
  - simpl at_zero. rewrite Qeq_R, zero_R. fold (t 0%nat). apply and_iff_compat_l. split.
    + intros H x y w I. exact (H _ I).
    + intros H [[x y] w] I. now apply H.
  - pose proof edges_right as H. induction H as [|b [[x y] w] bs l E F IH]; constructor; auto.
Qed.

Theorem valid_right : is_valid r = true <-> valid P epsilon g t.
Proof.
  unfold is_valid, valid. rewrite !andb_true_iff, !and_assoc. simpl is_steady. apply and_iff_compat_l.
  rewrite (all_verdicts _ (fun pq => apart epsilon t (fst pq) (snd pq)) close).
  - assert (E : (forall x, In x close -> apart epsilon t (fst x) (snd x)) <->
      forall p q, In (p, q) (mutex P) -> apart epsilon t p q).
    { split; [intros H p q I; now apply (H (p, q)), nodup_In | intros H [p q] I; apply nodup_In in I; now apply H]. }
    rewrite E. apply and_iff_compat_l. clear E. assert (D : forall before after, course P g t before after ->
      (forallb (fun b => b) (duties_met r) = true /\ forallb (fun b => b) (effects_agree r) = true <->
       forall d, In d (duties P ++ agreements (effects P)) -> met P g t before after d)).
    { intros before after C. destruct (duties_right before after C) as [A B].
      apply all_verdicts in A, B. rewrite A, B. split.
      - intros [H K] d I. apply in_app_iff in I as [I|I]; auto.
      - intros H. split; intros d I; apply H, in_app_iff; auto. }
    destruct (course_exists P g t) as [before [after C]]. split.
    + intros H. split; [eauto|]. intros b a C'. now apply (D b a C').
    + intros [_ H]. apply (D before after C). now apply H.
  - pose proof (proj2 pairs_right) as H. induction H as [|b [p q] bs l E F IH]; constructor; auto.
Qed.

End Right.
